"""Textile tests by the reference: the master curve, bending lengths, drape. `cases.py` declares them."""
