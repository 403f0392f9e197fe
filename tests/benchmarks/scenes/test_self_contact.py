"""Self-contact of scenes: as a method beside the reference, and as the ground truth of a run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.meshes import sphere
from benchmarks.methods.simulation import Simulation
from benchmarks.plan.plan import make_plan, protocol_of
from benchmarks.plan.study import StudyError
from benchmarks.results.protocol import OWN
from benchmarks.scenes import find_garment
from benchmarks.scenes.dressed_body import with_self_contact
from reference_sim import Cloth, Material, Obstacle
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from tests.benchmarks.methods.test_prepared_solvers import simulated_anew
from tests.benchmarks.plan.planned import study_with
from tests.benchmarks.runner.tasks_by_hand import prepared, small_scene
from tests.reference_sim.meshes import grid

pytest.importorskip("ipctk", reason="ipctk is not installed: no self-contact")


@pytest.fixture
def pressed_together():
    """A scene of two sheets, the upper one thrown onto the lower one."""
    scene = small_scene("hanging_sheet", cells=4, frames=8)
    x, faces = grid(3, 3, width=0.06, depth=0.06)
    above = x[:, [2, 1, 0]] * [0.8, 1, 0.9] + np.array([5e-3, 3e-3, 7e-3])
    start = np.concatenate([x, above])
    cloth = Cloth(
        start, np.concatenate([faces, faces[:, ::-1] + len(x)]), Material(), pins=[0, 3, 12, 15]
    )
    thrown = np.zeros_like(start)
    thrown[len(x) :] = [0.1, -0.3, 0.05]
    energies = (StretchStVK(cloth), BendHinge(cloth), Gravity(cloth))
    return dataclasses.replace(
        scene, cloth=cloth, energies=energies, minimised=with_self_contact(energies), pin_positions=None,
        settle=lambda: np.stack([start, thrown]), exact=None,
    )  # fmt: skip


def test_solvers_that_stop_early_know_no_self_contact_and_the_last_runs_pairs_are_forgotten(
    pressed_together,
):
    stopped = Simulation(options={"max_iterations": 2, "method": "newton"})
    stopped.prepare(pressed_together)
    assert "energy/barrier" not in stopped.run().frame_fields
    method = prepared("simulation", pressed_together)
    first = method.run()
    assert first.status == "converged" and first.frame_fields["energy/barrier"][-1] > 0.0
    assert np.array_equal(first.positions, method.run().positions)
    assert np.array_equal(first.positions, simulated_anew(method))


@pytest.mark.parametrize("exchange", ["springs", "printed-bending"])
def test_another_material_is_minimised_beside_the_barrier(exchange, pressed_together):
    points, faces = sphere(0.1, 4)
    scene = dataclasses.replace(pressed_together, obstacle=Obstacle(points - 1.0, faces))  # out of reach
    other = prepared(f"simulation-{exchange}", scene)
    minimised = {term.name: term for term in other.stepper.potential.energies}
    assert minimised["barrier"] is scene.minimised[-1]
    for declared, theirs in zip(scene.energies, other.scene.energies):
        mine, same = minimised[theirs.name], theirs is declared
        assert type(mine) is type(theirs) and (mine is declared) == same
        assert mine.parameters() == theirs.parameters()


def test_the_option_makes_it_the_ground_truth_of_dressed_scenes(monkeypatch):
    study = study_with(
        scenes=["tshirt/kick", "flag"],
        methods=["simulation", "snug"],
        split="validation",
        self_contact=True,
    )
    plan = make_plan(study)
    assert {s.name: s.self_contact for s in plan.scenes} == {"tshirt/kick": True, "flag": False}
    learned_from = find_garment("tshirt", plan.motions.garments).scene("walk")
    assert learned_from.self_contact
    of_kick, *_ = (cell for cell in plan.cells if cell.scene.dressed and cell.method == "simulation")
    assert protocol_of(of_kick, plan) == OWN  # another reference than that of the protocol
    without = make_plan(dataclasses.replace(study, self_contact=False))
    assert not any(scene.self_contact for scene in without.scenes)
    monkeypatch.setitem(make_plan.__globals__, "is_installed", lambda package: False)
    with pytest.raises(StudyError, match="self_contact: needs the package ipctk: pip install ipctk"):
        make_plan(study)
