"""Metrics of motion over time."""
