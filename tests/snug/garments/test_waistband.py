"""A waistband, which the body carries: in simulations, in skinning and in networks."""

import dataclasses

import igl
import numpy as np
import pytest

from benchmarks.assets import make_motions, open_assets
from benchmarks.methods import find_method
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.ground_truth import simulate_quasi_static
from reference_sim import Trajectory
from snug.motion.library import make_motion
from tests.benchmarks.runner.tasks_by_hand import context, dressed_scene
from tests.snug.training.dressing import tailored

TINY = dataclasses.replace(find_preset("smoke"), garment_vertices=300, frames=10, clip_frames=8)


@pytest.fixture(scope="module")
def small():
    return open_assets(TINY, make_motions(["turning_stop"]), ["skirt"])


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


def test_simulated_held_still_and_skinned_the_waistband_goes_with_the_body(scene, small, tmp_path):
    method = find_method("simulation").make(models=tmp_path, seed=0)
    method.prepare(scene)
    moving = method.run().positions
    declared = dressed_scene("turning_stop", "skirt", part="clip")
    simulate_quasi_static(declared, context(tmp_path, small), {})
    path = RunFolder(tmp_path).quasi_static_path(scene.name)
    still = Trajectory.load(path).positions
    pins = scene.cloth.pins
    assert scene.skinned[:, pins] == pytest.approx(handles(scene), abs=1e-5)
    for positions in (moving, still):
        assert positions[:, pins] == pytest.approx(handles(scene), abs=1e-9)
    # Nor does what hangs from it fall, or come to lie inside.
    assert moving[-1, :, 1].min() > handles(scene)[-1, :, 1].mean() - 0.6
    distance = igl.signed_distance(moving[-1], scene.obstacle.positions[-1], scene.obstacle.faces)[0]
    assert distance.min() > -0.01 and np.mean(distance < 0) < 0.02


def test_a_garment_that_falls_off_while_it_settles_has_no_start(small):
    loose = dataclasses.replace(small.garments["skirt"], pins=np.empty(0, dtype=np.int64))
    scene = dressed_scene("turning_stop", "skirt", part="clip")
    with pytest.raises(
        RuntimeError, match=r"garment skirt fell off while it settled for .* [01]\.\d m from"
    ):
        scene.build(dataclasses.replace(small, garments={"skirt": loose})).settle()
