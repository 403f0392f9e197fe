"""Known answers: derivatives of all terms, and properties of the minimisers. `cases.py` declares them."""
