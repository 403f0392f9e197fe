"""Validation: known answers and stress tests. Each room declares its cases; registry.py lists them."""
