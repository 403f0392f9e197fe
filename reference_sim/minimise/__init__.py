"""Minimisers of a Potential: Newton's method and L-BFGS, with one loop, one call and one type of result."""
