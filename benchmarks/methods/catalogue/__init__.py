"""Declarations of methods: networks, ablations, equal data, solvers; and the trainings of networks."""
