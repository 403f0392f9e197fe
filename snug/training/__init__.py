"""Training: loss, training set, steps, checkpoints, validation."""
