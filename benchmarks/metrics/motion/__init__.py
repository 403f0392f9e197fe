"""Metrics of motion over time: dynamics/*, conservation/*, exact/*, time_error/*, roll_out/*."""
