"""Sparse Hessians: their pattern, and their Cholesky factorisation."""
