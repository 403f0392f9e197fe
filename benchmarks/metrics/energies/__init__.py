"""Metrics of energy."""
