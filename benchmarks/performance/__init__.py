"""Microbenchmarks: speed of the simulator, trainings and trained networks. registry.py declares them."""
