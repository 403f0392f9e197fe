"""Metrics of cost and of training data: cost/*, solver/*, training_distance/*."""
