"""Known answers: the curvature metric on surfaces of known curvature. `cases.py` declares them."""
