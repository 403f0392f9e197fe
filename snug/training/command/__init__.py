"""The parts of the command `python -m snug.train`: options, choices, one training, curves."""
