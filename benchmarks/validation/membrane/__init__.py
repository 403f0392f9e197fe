"""Known answers: membrane."""
