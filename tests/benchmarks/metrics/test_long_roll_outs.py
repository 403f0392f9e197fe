"""Long roll-outs: both ends show one motion, a steady garment has no drift, a wandering one is found out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.metrics import roll_out as metric
from benchmarks.presets import PRESETS
from benchmarks.results.run_folder import model_path
from benchmarks.scenes import find_scene, hard_motions
from benchmarks.scenes.hard_motions import ENDS, EVERY, FRAMES, LOOP_BLEND
from snug.motion.library import make_motion
from snug.networks.roll_out import roll_out
from tests.benchmarks.runner.tasks_by_hand import assets_of, grouped, prepared
from tests.snug.training.dressing import random_model, swaying, tube_dress

SMOKE = PRESETS[0]


def long_scene(dressed):
    """The walk that comes again, in small."""
    return find_scene("out_of_distribution/long").at(SMOKE).build(assets_of(dressed, make_motion("walk")))


def found_of(scene, x):
    """Return the metric's measurements of the kept frames x (T,V,3) [m]."""
    return metric.measure_long_roll_out(grouped(scene, {"snug": x}).roll_outs[0])


@pytest.mark.parametrize("frames", [5, 77])
def test_the_last_hundred_frames_show_the_motion_of_the_first(frames):
    motion = swaying(frames)
    long = hard_motions.repeat_both_ways(motion)
    assert FRAMES <= long.frames < FRAMES + 2 * frames
    assert np.array_equal(long.poses[-ENDS:], long.poses[:ENDS])
    assert np.array_equal(long.translations[-ENDS:], long.translations[:ENDS])
    steps = np.abs(np.diff(long.translations, axis=0)).max()
    assert steps <= np.abs(np.diff(motion.translations, axis=0)).max()


def test_a_loop_comes_back_to_its_pose_and_goes_on_over_the_ground():
    walk = make_motion("walk")
    motion, early, late = hard_motions.repeat_walk(walk, 1000)
    loop = walk.frames + LOOP_BLEND
    assert motion.frames == 1000 and len(early) == len(late) == loop and early[0] == loop
    for frames in (early, late):
        assert np.array_equal(motion.poses[frames], motion.poses[:loop])
    assert late[-1] < 1000 <= late[-1] + loop
    assert motion.translations[loop, 1] == pytest.approx(motion.translations[0, 1], abs=1e-12)
    steps = [np.linalg.norm(np.diff(m.translations, axis=0), axis=1).max() for m in (motion, walk)]
    assert steps[0] == pytest.approx(steps[1], rel=0.2)


def test_the_long_roll_out_is_the_short_one_carried_on_and_only_some_frames_are_held(tmp_path):
    dressed, walk = tube_dress(), make_motion("walk")
    scene, model = long_scene(dressed), random_model("snug", dressed, [walk], seed=0)
    model.save(model_path(tmp_path, "snug", 0))
    x = prepared("snug", scene, tmp_path).run().positions
    motion, early, late = hard_motions.repeat_walk(walk, SMOKE.loop_frames)
    assert set(scene.kept) == {*range(0, SMOKE.loop_frames, EVERY), *early, *late}
    whole = roll_out(model, dressed, motion).positions
    assert np.array_equal(x, whole[scene.kept])
    assert [scene.kept[places].tolist() for places in scene.repeated] == [early.tolist(), late.tolist()]
    bare = dressed.skin(motion, smoothing=20)
    assert scene.skinned == pytest.approx(bare[scene.kept], abs=1e-12)
    # The state of an untrained network is soon forgotten.
    assert 0.0 < found_of(scene, x)["roll_out/drift"] < 1.0


def test_a_garment_that_wanders_is_found_out_wherever_the_body_went():
    scene = long_scene(tube_dress())
    x = scene.cloth.rest_positions + scene.dressed.motion.translations[scene.kept][:, None]
    assert found_of(scene, x)["roll_out/drift"] < 1e-9
    x[scene.repeated[1]] += [0.0, 0.003, 0.004]
    assert found_of(scene, x)["roll_out/drift"] == pytest.approx(5.0)
    assert found_of(scene, x[:-1]) == {}  # of one that ended early


def test_energy_of_a_rigid_flight_is_none_and_a_stop_costs_inertia():
    """Early it flies; late it stops: 5 frames each, the first two of which have no inertia."""
    dressed = tube_dress()
    scene = replace(long_scene(dressed), frames=10, repeated=(np.arange(5), np.arange(5, 10)))
    still = np.repeat(dressed.cloth.rest_positions[None], 10, axis=0)
    bending = found_of(scene, still)["roll_out/first"]
    x = still + 0.1 * np.arange(10)[:, None, None]
    assert found_of(scene, x)["roll_out/last"] == pytest.approx(bending, rel=1e-9) and bending > 0.0
    x[8:] = x[7]
    measures = found_of(scene, x)
    expected = 0.5 * dressed.cloth.masses.sum() * 3 * (0.1 * 30) ** 2 / 3
    assert measures["roll_out/first"] == pytest.approx(bending, rel=1e-9)
    assert measures["roll_out/last"] - bending == pytest.approx(expected, rel=1e-9)
