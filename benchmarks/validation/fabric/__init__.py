"""Textile tests by the reference, from the master curve to stick-slip. `cases.py` declares them."""
