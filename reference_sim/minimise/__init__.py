"""Minimisers of a Potential: Newton's method and L-BFGS, with one loop, call and result."""
