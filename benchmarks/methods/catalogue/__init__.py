"""Declarations of methods, in blocks."""
