"""Numbers computed from the rows of a run: means and spreads, significance, the paper's claims, break-even."""
