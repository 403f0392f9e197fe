"""Command lines: what all commands share, and the pieces of `python -m reference_sim.simulate`."""
