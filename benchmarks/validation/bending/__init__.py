"""Known answers: bending."""
