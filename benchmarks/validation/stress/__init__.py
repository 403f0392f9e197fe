"""Known answers: stress."""
