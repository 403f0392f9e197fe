"""How fast the reference simulator is, and what of: one command, `python -m benchmarks.solver_speed`."""
