"""Solvers that are prepared once: a run sets nothing up, and gives the bits of a simulation made anew."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.methods import find_method
from benchmarks.methods.simulation import Simulation
from reference_sim import cholesky, potential, simulate
from reference_sim.minimise import factorised, lbfgs
from tests.benchmarks.runner.tasks_by_hand import small_scene

SOLVERS = (
    "simulation", "simulation-dt/2", "simulation-refrozen", "newton-2", "lbfgs-10", "fast-lbfgs-10", "vbd-20",
    "xpbd-40",
)  # fmt: skip
SET_UP = (  # what analyses a pattern
    (potential, "nested_dissection"), (cholesky, "nested_dissection"), (factorised, "analyse"),
    (lbfgs, "analyse"),
)  # fmt: skip


def simulated_anew(method: Simulation) -> np.ndarray:
    """Positions of `simulate`, with the scene and the options of a method."""
    scene = method.scene
    assert scene is not None
    options = method.options | {"substeps": scene.substeps * method.options.get("substeps", 1)}
    energies = scene.energies if "max_iterations" in options else scene.simulated_energies
    return simulate(
        scene.cloth, energies, dt=scene.dt, frames=scene.frames, obstacle=scene.obstacle, start=scene.start,
        velocity=scene.start_velocity, pin_positions=scene.pin_positions, **options,
    ).positions  # fmt: skip


@pytest.mark.parametrize("name", SOLVERS)
def test_a_run_sets_nothing_up_and_all_runs_give_the_bits_of_a_new_simulation(name, monkeypatch):
    scene = small_scene("sheet_on_sphere", cells=6, frames=6)
    method = find_method(name).make(models=None, seed=0)
    method.prepare(scene)
    for module, function in SET_UP:
        monkeypatch.setattr(module, function, lambda *_: pytest.fail("set up on the clock"))
    runs = [method.run().positions for _ in range(2)]
    monkeypatch.undo()
    assert np.array_equal(*runs) and np.array_equal(runs[0], simulated_anew(method))
