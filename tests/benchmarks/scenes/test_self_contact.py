"""Self-contact of scenes: as a method beside the reference, and as the ground truth of a run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.methods import find_method
from benchmarks.methods.simulation import Simulation
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics import conservation
from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.plan import protocol_of
from benchmarks.plan.study import StudyError
from benchmarks.results.protocol import OWN
from benchmarks.scenes import of_garment
from benchmarks.scenes.self_contact import with_self_contact
from reference_sim import Cloth, Material
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from reference_sim.minimise.newton import Newton
from reference_sim.time_loop import simulate
from tests.benchmarks.plan.planned import planned, study_with
from tests.benchmarks.runner.tasks_by_hand import small_scene
from tests.reference_sim.meshes import grid

pytest.importorskip("ipctk", reason="ipctk is not installed: no self-contact")

METHOD = "simulation-self-contact"


def two_sheets(height: float):
    """A scene of two free sheets; the upper one starts at `height` [m] and stands on edge below 0.02."""
    scene = small_scene("hanging_sheet", cells=4, frames=4)
    x, faces = grid(3, 3, width=0.06, depth=0.06)
    cloth = Cloth(
        np.concatenate([x, x + np.array([0, 0.1, 0])]), np.concatenate([faces, faces + len(x)]), Material()
    )
    upright = np.stack([x[:, 0] + 0.003, x[:, 2] - 0.03 + height, 0.031 + 0 * x[:, 2]], axis=1)
    start = np.concatenate([x, upright])
    energies = (StretchStVK(cloth), BendHinge(cloth), Gravity(cloth))
    return dataclasses.replace(
        scene, cloth=cloth, energies=energies, settle=lambda: start, pin_positions=None, exact=None
    )


def made(scene):
    method = find_method(METHOD).make(models=None, seed=0)
    method.prepare(scene)
    return method


def test_where_nothing_meets_it_is_the_simulation_and_is_measured_without_its_barrier():
    scene = small_scene("hanging_sheet", cells=4, frames=5)
    reference = Simulation(options={})
    reference.prepare(scene)
    expected, method = reference.run(), made(scene)
    trajectory = method.run()
    assert np.array_equal(trajectory.positions, expected.positions)
    assert "energy/barrier" in trajectory.frame_fields
    assert "energy/barrier" not in expected.frame_fields
    assert [term.name for term in method.scene.energies] == ["strain", "bending", "gravity"]
    entry = find_method(METHOD)
    assert (entry.role, entry.reporting.base, entry.package) == ("ablation", "simulation", "ipctk")


def test_solvers_that_stop_early_know_no_self_contact():
    scene = two_sheets(0.05)
    scene = dataclasses.replace(scene, minimised=with_self_contact(scene.energies))
    stopped = Simulation(options={"max_iterations": 2, "method": "newton"})
    stopped.prepare(scene)
    assert "energy/barrier" not in stopped.run().frame_fields
    whole = Simulation(options={})
    whole.prepare(scene)
    assert "energy/barrier" in whole.run().frame_fields


def test_nor_do_those_that_start_elsewhere_and_subspaces_whose_minimiser_is_a_function():
    scene = two_sheets(0.05)
    declared = Simulation(options={"method": lambda potential, **options: Newton(potential, **options)})
    declared.prepare(dataclasses.replace(scene, minimised=with_self_contact(scene.energies)))
    trajectory = declared.run()
    assert trajectory.status == "converged" and "energy/barrier" not in trajectory.frame_fields


@pytest.mark.parametrize("exchange", ["springs", "pbns-springs", "printed-bending"])
def test_another_material_is_minimised_beside_the_barrier(exchange):
    scene = two_sheets(0.05)
    scene = dataclasses.replace(scene, minimised=with_self_contact(scene.energies))
    other = find_method(f"simulation-{exchange}").make(models=None, seed=0)
    other.prepare(scene)
    minimised = {term.name: term for term in other.stepper.potential.energies}
    assert minimised["barrier"] is scene.minimised[-1]
    for declared, theirs in zip(scene.energies, other.scene.energies):
        mine, kept = minimised[theirs.name], theirs is declared
        assert type(mine) is type(theirs) and (mine is declared) == kept
        assert mine.parameters() == theirs.parameters()


def test_laws_are_those_of_what_is_minimised(monkeypatch):
    scene = two_sheets(0.035)
    scene = dataclasses.replace(scene, frames=6, minimised=with_self_contact(scene.energies))
    thrown = np.zeros(scene.start.shape)
    thrown[len(thrown) // 2 :, 1] = -0.5  # [m/s] the upper sheet, towards the lower one
    trajectory = simulate(
        scene.cloth, scene.minimised, dt=scene.dt, frames=6, start=scene.start, velocity=thrown
    )
    group = SceneRollOuts(scene)
    group.roll_outs.append(RollOut(group, find_method("simulation"), trajectory))
    monkeypatch.setattr(conservation, "_asked", lambda group: group.roll_outs)  # though nobody is dressed
    (declared,) = conservation.law_series(scene, [trajectory.positions])
    (minimised,) = conservation._laws_of(group).values()
    assert minimised.residual.max() <= 1e-6 < declared.residual.max()


def test_a_start_that_crosses_itself_is_settled_anew_or_refused():
    crossed, free = two_sheets(0.0), two_sheets(0.05)
    message = r"edge \(\d+, \d+\) of the cloth cuts face \d+ of the cloth where it starts.*mend the mesh"
    with pytest.raises(ValueError, match=message):
        made(crossed)
    again = made(dataclasses.replace(crossed, settle_uncrossed=lambda: free.start))
    assert np.array_equal(again.scene.start, free.start)
    kept = made(dataclasses.replace(free, settle_uncrossed=lambda: crossed.start))
    assert np.array_equal(kept.scene.start, free.start)


def test_the_option_makes_it_the_ground_truth_of_dressed_scenes(monkeypatch):
    study = study_with(
        scenes=["tshirt/kick", "flag"], methods=["simulation", "snug"], split="validation", self_contact=True
    )
    plan = make_plan(study)
    assert {scene.name: scene.self_contact for scene in plan.scenes} == {"tshirt/kick": True, "flag": False}
    assert of_garment("tshirt", plan.motions.worn).scene("walk").self_contact  # of what networks learn from
    of_kick, *_ = (cell for cell in plan.cells if cell.scene.dressed and cell.method == "simulation")
    assert protocol_of(of_kick, plan) == OWN  # another reference than that of the protocol
    without = make_plan(dataclasses.replace(study, self_contact=False))
    assert not any(scene.self_contact for scene in without.scenes)
    monkeypatch.setitem(make_plan.__globals__, "installed", lambda package: False)
    with pytest.raises(StudyError, match="--self_contact: needs the package ipctk: pip install ipctk"):
        make_plan(study)


def test_garments_have_it_as_a_row_beside_the_simulation_where_it_is_named():
    plan = planned("--scenes", "tunic/*", "--methods", f"simulation,{METHOD}")
    assert {cell.method for cell in plan.cells} == {"simulation", METHOD}
