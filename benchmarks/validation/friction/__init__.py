"""Known answers: friction."""
