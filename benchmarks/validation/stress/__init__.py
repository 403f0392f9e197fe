"""Stress tests: single steps that converge truly or fail and say so. `cases.py` declares them."""
