"""Known answers: backward Euler against its discrete laws, and orders in dt. `cases.py` declares them."""
