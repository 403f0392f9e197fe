"""Known answers: Coulomb friction on planes and drums. `cases.py` declares them."""
