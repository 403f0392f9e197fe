"""Foundations of all compiled kernels: their cache on disk, lanes of elements, kernels as arguments."""
