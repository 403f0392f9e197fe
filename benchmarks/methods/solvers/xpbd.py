"""Position-based dynamics with constraints that carry our own energies, cut after a number of sweeps."""

from __future__ import annotations

from pathlib import Path

from benchmarks.methods.minimisers.xpbd import XPBD
from benchmarks.methods.solvers.simulation import Simulation


def make(*, models: Path, seed: int, iterations: int) -> Simulation:
    """Make a simulation whose every step is `iterations` sweeps of XPBD."""
    return Simulation(options={"method": XPBD, "max_iterations": iterations})
