"""Audit of engines: laws of mechanics, distance from their own limit, time. `cases.py` declares them."""
