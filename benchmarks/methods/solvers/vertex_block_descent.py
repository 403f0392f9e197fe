"""Vertex block descent on our own energies, cut after a number of sweeps."""

from __future__ import annotations

from pathlib import Path

from benchmarks.methods.minimisers.block_descent import VertexBlockDescent
from benchmarks.methods.solvers.simulation import Simulation


def make(*, models: Path, seed: int, iterations: int) -> Simulation:
    """Make a simulation whose every step is `iterations` sweeps of vertex block descent."""
    return Simulation(options={"method": VertexBlockDescent, "max_iterations": iterations})
