"""Losses: energies of the simulator, distances from simulated vertices, PBNS's own material."""
