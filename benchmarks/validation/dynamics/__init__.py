"""Known answers: dynamics."""
