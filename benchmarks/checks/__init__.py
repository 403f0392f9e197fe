"""Checks with an exact answer: each function measures one number whose value is known in advance."""
