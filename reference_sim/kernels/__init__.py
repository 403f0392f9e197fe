"""Foundations of all compiled kernels: their cache on disk, lanes of elements, indices of blocks."""
