"""How fast networks train and run: one command, `python -m benchmarks.training_speed`."""
