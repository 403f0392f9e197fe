"""Foundations of compiled kernels: their cache on disk, layouts, and how terms declare them."""
