"""Readers of the files users bring: bodies and motions."""
