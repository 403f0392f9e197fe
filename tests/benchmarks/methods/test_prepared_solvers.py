"""Solvers that are prepared once: a run sets nothing up, and gives the bits of a simulation made anew."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.method import Method
from benchmarks.methods import sweeps
from benchmarks.methods.simulation import Simulation
from benchmarks.methods.warm_started import WarmStarted
from reference_sim import potential
from reference_sim.minimise import compiled_lbfgs, factorised, lbfgs
from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS
from tests.benchmarks.runner.tasks_by_hand import prepared, simulated, small_scene

SOLVERS = (
    "simulation", "simulation-dt/2", "simulation-refrozen", "newton-2", "lbfgs-10", "fast-lbfgs-10", "vbd-20",
    "xpbd-40",
)  # fmt: skip
SET_UP = (  # what analyses a pattern
    (potential, "nested_dissection"), (compiled_lbfgs, "Cholesky"), (factorised, "Cholesky"),
    (lbfgs, "Cholesky"), (sweeps, "incidence"),
)  # fmt: skip


def simulated_anew(method: Simulation) -> np.ndarray:
    """Positions of `simulate`, with the scene and the options of a method."""
    scene = method.scene
    assert scene is not None
    options = method.options | {"substeps": scene.substeps * method.options.get("substeps", 1)}
    if "max_iterations" not in options:
        scene = dataclasses.replace(scene, energies=scene.simulated_energies)
    return simulated(scene, **options).positions


def assert_sets_nothing_up(method: Method, monkeypatch) -> None:
    def set_up(*arguments):
        raise AssertionError("set up on the clock")

    with monkeypatch.context() as patch:
        for module, name in SET_UP:
            patch.setattr(module, name, set_up)
        method.run()


@pytest.mark.parametrize("name", SOLVERS)
def test_a_run_sets_nothing_up_and_all_runs_give_the_bits_of_a_new_simulation(name, monkeypatch):
    scene = small_scene("sheet_on_sphere", cells=6, frames=6)
    method = prepared(name, scene)
    assert_sets_nothing_up(method, monkeypatch)
    runs = [method.run().positions for _ in range(2)]
    assert np.array_equal(*runs) and np.array_equal(runs[0], simulated_anew(method))


@pytest.mark.parametrize("solver", [CompiledLBFGS, "newton", "lbfgs"])
def test_a_warm_started_solver_begins_its_frames_and_residuals_anew(solver, monkeypatch, tmp_path):
    scene = small_scene("hanging_sheet", frames=6)

    def frames() -> Iterator[np.ndarray]:
        return (scene.start + np.array([0.0, -2e-3 * frame, 0.0]) for frame in range(scene.frames))

    def method() -> WarmStarted:
        cut_short = {"method": solver, "max_iterations": 2}
        method = WarmStarted(options={}, guess="skinning", path=tmp_path, solver=cut_short, residual=True)
        monkeypatch.setattr(method, "_frames", lambda scene: frames)
        as_it_is = SimpleNamespace(carry=lambda residual, frame: residual)
        monkeypatch.setattr(method, "_carry", lambda scene: as_it_is)
        method.prepare(scene)
        return method

    served = method()
    assert_sets_nothing_up(served, monkeypatch)
    runs = [served.run().positions, served.run().positions, method().run().positions]
    assert np.array_equal(runs[0], runs[1]) and np.array_equal(runs[0], runs[2])
    assert np.abs(runs[0][1:] - scene.start).max() > 1e-3
