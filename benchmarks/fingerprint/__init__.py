"""Fingerprints of values, source code, packages and data files: what makes a stored result stale."""
