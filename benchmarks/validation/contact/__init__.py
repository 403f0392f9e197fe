"""Known answers: contact."""
