"""Validation: known answers and extreme steps. registry.py lists the modules whose functions declare them."""
