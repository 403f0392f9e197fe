"""L-BFGS compiled as a whole, in float32 (reference_sim.minimise.compiled_lbfgs)."""

from __future__ import annotations

from pathlib import Path

from benchmarks.methods.solvers.simulation import Simulation
from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS


def make(*, models: Path, seed: int, iterations: int) -> Simulation:
    """Make a simulation whose every step is `iterations` of compiled L-BFGS."""
    return Simulation(options={"method": CompiledLBFGS, "max_iterations": iterations})
