"""Known answers: solvers."""
