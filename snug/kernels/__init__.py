"""Compiled kernels of training and of inference on a CPU."""
