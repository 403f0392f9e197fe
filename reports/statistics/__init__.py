"""Means, effects with intervals, fronts, claims."""
