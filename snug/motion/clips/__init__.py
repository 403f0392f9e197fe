"""Motions of the embedded library, as readable tables of angles and published curves."""
