"""Numbers computed from rows: means and spreads, significance, the paper's claims, break-even."""
