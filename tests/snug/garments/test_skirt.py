"""The skirt: its cut, weights between the thighs, a waistband that the body carries, in every method."""

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
from snug.body.skeleton import JOINT
from snug.motion.library import make_motion
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel
from snug.training.train_network import untrained_model
from tests.benchmarks.runner.tasks_by_hand import context, dressed_scene
from tests.reference_sim.meshes import girth
from tests.snug.training.dressing import short, tailored

TINY = dataclasses.replace(find_preset("smoke"), garment_vertices=300, frames=10, clip_frames=8)


@pytest.fixture
def skirt():
    return tailored("skirt", 600)


@pytest.fixture(scope="module")
def small():
    return open_assets(TINY, embedded_motions(["turning_stop"]), ["skirt"])


@pytest.fixture(scope="module")
def scene(small):
    return dressed_scene("turning_stop", "skirt", part="clip").build(small)


def test_a_skirt_fits_waist_and_hips_and_has_two_even_rims(body, skirt):
    points = skirt.rest_positions
    assert np.array_equal(skirt.pins, np.sort(skirt.loops["waist"]))
    distance = igl.signed_distance(points, body.template, body.faces)[0]
    waist, hem = (points[skirt.loops[name]] for name in ("waist", "hem"))
    hip, knee = (body.joint_template[JOINT[n], 1] for n in ("left_hip", "left_knee"))
    assert (
        np.ptp(waist[:, 1]) < 1e-4 and np.ptp(hem[:, 1]) < 1e-4 and knee < hem[0, 1] < hip < waist[0, 1]
    )
    assert distance[skirt.pins].max() < 0.012  # the band lies close
    levels = np.linspace(hem[0, 1], waist[0, 1], 10)[1:-1]
    girths = [girth(points, skirt.faces, 1, level) for level in levels]
    assert np.diff(girths).max() < 0 and girths[0] > 1.6 * girths[-1]


def test_between_the_thighs_a_skirt_follows_both(body, skirt):
    """The jump from leg to leg that borrowed weights have is gone; at the sides it follows its own thigh."""
    x, w = skirt.rest_positions[:, 0], skirt.skinning_weights
    left, right = (w[:, JOINT[f"{side}_hip"]] for side in ("left", "right"))
    hem = np.isin(np.arange(len(x)), skirt.hem)
    middle, side = hem & (np.abs(x) < 0.02), hem & (x > 0.25)
    assert np.abs(left - right)[middle].max() < 0.15 and (left - right)[side].min() > 0.3
    assert np.allclose(w.sum(axis=1), 1.0, atol=1e-12) and w.min() >= 0


def test_the_body_carries_the_waistband_close(body, skirt):
    motion = make_motion("turning_stop")
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


@pytest.mark.parametrize("kind", ["snug", "pbns"])
def test_no_network_moves_the_waistband(scene, kind, tmp_path):
    """Neither skinning alone, nor before training, nor after it, nor read again from its file."""
    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    motion, pins = scene.dressed.motion, scene.cloth.pins
    assert dressed.skinned(motion, smoothing=20)[:, pins] == pytest.approx(handles(scene), abs=1e-5)
    trained = short(kind, dressed=dressed, motions=[motion], steps=5)
    untrained = untrained_model(kind, dressed, [motion], seed=0)
    read = TrainedModel.load(
        untrained.save(tmp_path / "m.safetensors")
    )  # weights at the waistband: not zero
    free = np.setdiff1d(np.arange(dressed.vertices), pins)
    for model in (untrained, trained, read):
        positions = roll_out(model, dressed, motion).positions
        assert positions[:, pins] == pytest.approx(handles(scene), abs=1e-5)
        skinned = dressed.skinned(motion, smoothing=model.recipe.smoothing)
        assert np.abs(positions - skinned)[:, free].max() > 1e-4
