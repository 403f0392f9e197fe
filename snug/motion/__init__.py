"""Motions: joint rotations over time, the embedded library, files of motion capture."""
