"""A waistband, which the body carries: in simulations, in skinning and in networks."""

import dataclasses

import igl
import numpy as np
import pytest

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.methods import find_method
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.ground_truth import simulate_quasi_static
from reference_sim import Trajectory
from snug.motion.library import make_motion
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.training.train_network import untrained_model
from tests.benchmarks.runner.tasks_by_hand import context, dressed_scene
from tests.snug.training.dressing import tailored

TINY = dataclasses.replace(find_preset("smoke"), garment_vertices=300, frames=10, clip_frames=8)


@pytest.fixture(scope="module")
def small():
    return open_assets(TINY, embedded_motions(["turning_stop"]), ["skirt"])


@pytest.fixture(scope="module")
def scene(small):
    return dressed_scene("turning_stop", "skirt", part="clip").build(small)


def test_the_body_carries_the_waistband_close(body):
    skirt, motion = tailored("skirt", 600), make_motion("turning_stop")
    frames = slice(20, 60, 10)
    poses, translations = motion.poses[frames], motion.translations[frames]
    transported, skins = (
        skirt.pin_positions(body, poses, translations),
        body.vertices(poses, translations),
    )
    assert transported.shape == (4, len(skirt.pins), 3)
    for band, skin in zip(transported, skins, strict=True):
        assert np.abs(igl.signed_distance(band, skin, body.faces)[0]).max() < 0.02
    still = skirt.pin_positions(body, np.zeros((1, 24, 3)), np.zeros((1, 3)))[0]
    assert still == pytest.approx(skirt.rest_positions[skirt.pins], abs=1e-12)


def handles(scene):
    return np.stack([scene.pin_positions(frame) for frame in range(scene.frames)])


def test_simulated_and_held_still_the_waistband_goes_with_the_body(scene, small, tmp_path):
    method = find_method("simulation").make(models=tmp_path, seed=0)
    method.prepare(scene)
    moving = method.run().positions
    declared = dressed_scene("turning_stop", "skirt", part="clip")
    simulate_quasi_static(declared, context(tmp_path, small), {})
    path = RunFolder(tmp_path).quasi_static_path(scene.name)
    still = Trajectory.load(path).positions
    pins = scene.cloth.pins
    for positions in (moving, still):
        assert positions[:, pins] == pytest.approx(handles(scene), abs=1e-9)
    # Nor does what hangs from it fall, or come to lie inside.
    assert moving[-1, :, 1].min() > handles(scene)[-1, :, 1].mean() - 0.6
    distance = igl.signed_distance(moving[-1], scene.obstacle.positions[-1], scene.obstacle.faces)[0]
    assert distance.min() > -0.01 and np.mean(distance < 0) < 0.02


def test_no_network_moves_the_waistband(scene):
    """Nor does skinning alone; all else moves. test_frame_layout holds this of every kind and its file."""
    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    motion, pins = scene.dressed.motion, scene.cloth.pins
    model = untrained_model("snug", dressed, [motion], seed=0)
    positions = roll_out(model, dressed, motion).positions
    skinned = dressed.skinned(motion, smoothing=model.recipe.smoothing)
    for x in (skinned, positions):
        assert x[:, pins] == pytest.approx(handles(scene), abs=1e-5)
    free = np.setdiff1d(np.arange(dressed.vertices), pins)
    assert np.abs(positions - skinned)[:, free].max() > 1e-4
