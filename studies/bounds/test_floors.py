"""The floor of handles and of last layers: converged, within its subspace, above the simulation's step."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks.metrics.energy import copied_terms, freeze_step
from benchmarks.plan.user_files import METHODS, entries_of
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import model_path
from reference_sim import Potential, minimise
from reference_sim.trajectory import Trajectory
from snug.body.skinning import unskin
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import make_network
from snug.networks.handles import shape_functions, span
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT
from tests.benchmarks.runner.tasks_by_hand import assets_of, dressed_scene, prepared
from tests.snug.training.dressing import swaying, tube_dress

FRAMES = 5
FLOORS = {entry.name: entry for entry in entries_of(METHODS, str(Path(__file__).with_name("floors.py")))}


@pytest.fixture(scope="module")
def scene():
    preset = dataclasses.replace(find_preset("smoke"), settle_frames=4)
    motion = swaying(FRAMES)
    return dressed_scene(motion.name, preset=preset).build(assets_of(tube_dress(), motion))


@pytest.fixture(scope="module")
def floor(scene):
    return prepared(FLOORS["handles-20-floor"], scene).run()


def unposed(scene, positions) -> np.ndarray:
    """Offsets (T, 3 V) that skinning with the recipe's weights takes to positions."""
    dressed, motion = DressedBody(scene.dressed.body, scene.dressed.garment), scene.dressed.motion
    local = torch.from_numpy(positions - dressed.pelvis(motion)[:, None])
    weights = dressed.weights(DEFAULT.smoothing).double()
    transforms = dressed.transforms(motion.poses).double()
    return (unskin(local, weights, transforms) - dressed.rest().double()).flatten(1).numpy()


def left_over(columns: np.ndarray, offsets: np.ndarray) -> float:
    return float(np.abs(columns @ np.linalg.lstsq(columns, offsets.T)[0] - offsets.T).max())


def test_every_step_is_a_minimum_within_the_handles_and_above_that_of_all_vertices(
    scene, floor, tmp_path
):
    assert floor.status == "converged" and floor.frame_fields["converged"].all()
    floor.save(tmp_path / "floor.vtkhdf")
    assert Trajectory.load(tmp_path / "floor.vtkhdf").provenance["options"]["method"] == "in_subspace"
    columns = span(shape_functions(scene.dressed.garment, 20))
    offsets = unposed(scene, floor.positions)
    assert left_over(columns, offsets) < 1e-8 and np.abs(offsets).max() > 0.01
    potential = Potential(copied_terms(scene))
    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    weight = scene.cloth.masses.mean() * 9.81
    weights = dressed.weights(DEFAULT.smoothing).double().numpy()
    transforms = dressed.transforms(scene.dressed.motion.poses).double().numpy()
    for frame in range(1, FRAMES):
        freeze_step(scene, potential, floor.positions, frame)
        x = np.ascontiguousarray(floor.positions[frame])
        assert potential.value(x) == pytest.approx(
            sum(floor.frame_fields[f"energy/{term.name}"][frame] for term in potential.energies), abs=1e-9
        )
        assert minimise(potential, x).energy < potential.value(x)
        # No force is left along any number of any handle, though there is along vertices.
        turns = np.einsum("vj,jik->vik", weights, transforms[frame, ..., :3])
        forces = np.einsum("vij,vi->vj", turns, potential.gradient(x))
        sizes = np.linalg.norm(columns, axis=0)
        nothing = 2e-6 * weight * np.sqrt(columns.shape[1])
        assert np.abs(columns.T @ forces.ravel() / sizes).max() < nothing
        assert np.abs(forces).max() > 0.1 * weight


def test_more_handles_have_less_energy(scene, floor):
    finer = prepared(FLOORS["handles-40-floor"], scene).run()
    assert finer.status == "converged"

    def energy(trajectory):
        parts = [v for name, v in trajectory.frame_fields.items() if name.startswith("energy/")]
        return float(np.sum(parts, axis=0)[2:].mean())

    assert energy(prepared("simulation", scene).run()) < energy(finer) < energy(floor)


def test_the_floor_of_a_network_lies_in_the_span_of_its_last_layer(scene, tmp_path):
    vertices = scene.cloth.vertex_count
    network = make_network(
        "pbns", 141, vertices, dataclasses.replace(DEFAULT, zero_last_layer=False), seed=0
    )
    TrainedModel("pbns", network, DEFAULT).save(model_path(tmp_path, "pbns", 0))
    floor = prepared(FLOORS["pbns-floor"], scene, tmp_path).run()
    assert floor.status == "converged"
    columns, _ = network.offset_space()
    assert left_over(columns.double().numpy(), unposed(scene, floor.positions)) < 1e-6
