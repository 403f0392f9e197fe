"""Metrics of a surface, from positions alone."""
