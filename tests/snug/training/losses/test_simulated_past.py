"""Networks of garments that swing: what they see of a motion, and inertia about a simulation's past."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from snug.body.skeleton import JOINT, axis_angles, rotation_matrices
from snug.motion.motion import Motion, turn_about_vertical
from snug.named_recipes import DYNAMIC
from snug.networks.dressed_body import HISTORY, RATED_JOINTS, motion_history, motion_rates
from snug.networks.roll_out import roll_out
from snug.training.augmentation import (
    HELD_FRAMES,
    MAX_DEGREE_HERTZ,
    SPEEDS,
    TRANSITION_FRAMES,
    make_mixed_clips,
    make_shared_clips,
    make_swinging_motion,
)
from snug.training.optimisation_step import Trainer
from snug.training.simulated_data import NEARNESS, SimulatedPast, TargetError
from snug.training.train_network import train_network
from snug.training.training_set import TrainingSet
from tests.snug.motion.motion_forms import joint_speeds
from tests.snug.training.dressing import swaying, tube_dress

SMALL = replace(DYNAMIC, pretraining=0)
MASSES = tube_dress().cloth.masses


def thrown(motion, speed=2.0):
    """World vertices (T, V, 3) that fly off the skinned first frame at that speed [m/s]."""
    first = tube_dress().skinned(motion)[0]
    ways = np.random.default_rng(0).normal(size=first.shape)
    time = np.arange(motion.frames)[:, None, None] / motion.fps
    return first + speed * time * ways


def past_of(motions, trajectories):
    data = TrainingSet(tube_dress(), motions, SMALL, features="history", sequences=False)
    return data, SimulatedPast(data, motions, trajectories)


def test_cloth_that_flies_on_has_no_inertia_and_what_is_off_has_that_of_its_displacement():
    motion = swaying(12)
    x = thrown(motion)
    data, past = past_of([motion], {motion.name: x})
    relative = torch.as_tensor(x - tube_dress().pelvis(motion)[:, None]).float()[:, None]
    batch = data.batch(np.arange(12), None)
    terms = past.terms(relative, batch)
    assert terms["inertia"].shape == (12, 1) and float(terms["inertia"].max()) < 1e-6
    assert not terms["distance"].any()
    off = past.terms(relative + 0.01 * torch.ones(3), batch)
    expected = torch.full((12, 1), float(0.5 * MASSES.sum() * 30.0**2 * 3e-4))
    torch.testing.assert_close(off["distance"], NEARNESS * expected, rtol=1e-3, atol=0)
    expected[:2] = 0.0  # two frames before it are missing
    torch.testing.assert_close(off["inertia"], expected, rtol=1e-3, atol=0)


def test_the_past_of_another_motion_is_not_its_own_and_what_is_not_simulated_has_none():
    motions = [swaying(8), swaying(9, name="other", degrees=15.0), swaying(7, name="alone")]
    known = {motion.name: thrown(motion) for motion in motions[:2]}
    data = TrainingSet(tube_dress(), motions, SMALL, features="history", sequences=False)
    past = SimulatedPast(data, motions[:2], known)
    still = torch.zeros(3, 1, tube_dress().vertices, 3)
    batch = data.batch(np.array([9, 16, 17]), None)
    terms = past.terms(still, batch)
    assert terms["inertia"].flatten().bool().tolist() == [False, True, False]  # 9: a second frame
    assert terms["distance"].flatten().bool().tolist() == [True, True, False]  # 17: not simulated
    with pytest.raises(TargetError, match=r"no simulated trajectory.*'other'"):
        SimulatedPast(data, motions, {motions[0].name: known[motions[0].name]})
    known["other"][5, 7, 1] = np.nan
    with pytest.raises(TargetError, match="'other' is not finite at frame 5"):
        SimulatedPast(data, motions[:2], known)


def turning(rate=1.5, frames=20, heading=0.0):
    """A body that turns to the left and speeds up sideways."""
    time = np.arange(frames) / 30.0
    poses = np.zeros((frames, 24, 3))
    poses[:, 0, 1] = rate * time + heading
    around = rotation_matrices(np.array([0.0, heading, 0.0]))
    path = np.stack([2.0 * time**2, 0 * time, 0 * time], axis=1) @ around.T
    return Motion("turning", poses, path)


def test_rates_tell_of_turning_and_of_a_stop():
    rates = motion_rates(turning())
    assert rates.shape == (20, 6 + 3 * len(RATED_JOINTS) + 12)
    np.testing.assert_allclose(rates[1:, 7], 1.5, rtol=1e-9)  # the pelvis' turn about y [rad/s]
    speeds = np.linalg.norm(rates[:, :3], axis=1)
    np.testing.assert_allclose(np.diff(speeds)[2:], 4.0 / 30.0, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(rates[2:, 3:6], axis=1), 4.0, rtol=1e-6)
    stopped = turning().poses[np.minimum(np.arange(20), 12)]
    after = motion_rates(Motion("stop", stopped, np.zeros((20, 3))))
    assert after[13, 7] == 0 and after[13, 6 + 30 + 1] == pytest.approx(-45.0)  # [rad/s^2]
    assert np.all(after[15:] == 0)


def test_rates_do_not_know_north():
    np.testing.assert_allclose(motion_rates(turning(heading=1.1)), motion_rates(turning()), atol=1e-9)
    bent = turning().poses.copy()
    bent[:, 0] = axis_angles(rotation_matrices(bent[:, 0]))
    assert np.isfinite(motion_rates(Motion("bent", bent, np.zeros((20, 3))))).all()


def test_a_history_is_every_rate_once_and_no_later_one():
    motion = swaying(HISTORY + 9)
    rates = motion_rates(motion)
    history = motion_history(motion).reshape(motion.frames, -1, rates.shape[1])
    np.testing.assert_array_equal(history[:, 0], rates)
    np.testing.assert_allclose(history[7, 5], rates[1:3].mean(0))  # 5 and 6 frames ago
    frames = np.array([1, 1, 1, 1, 1, 2, 2, 3, 3, 4, 4])
    whole = np.einsum("tsd,s->td", history, frames)
    last = np.array([rates[max(0, t - HISTORY + 1) : t + 1].sum(0) for t in range(motion.frames)])
    np.testing.assert_allclose(whole, last, atol=1e-9)
    held = motion.poses[np.minimum(np.arange(HISTORY + 9), 5)]
    rested = motion_history(Motion("held", held, np.zeros((HISTORY + 9, 3))))
    assert rested[HISTORY + 5].any() and not rested[HISTORY + 7 :].any()


@pytest.mark.slow
def test_training_brings_the_swing_into_the_network():
    motions = [swaying(30), swaying(26, name="other", degrees=15.0)]
    trajectories = {motion.name: thrown(motion, 0.05) for motion in motions}
    rows: list[dict[str, float]] = []
    model = train_network(
        "dynamic", tube_dress(), motions, steps=16, seed=1, recipe=SMALL, trajectories=trajectories,
        log=rows.append, progress=False, every=4,
    )  # fmt: skip
    assert rows[-1]["loss"] < rows[0]["loss"] and 0 < rows[-1]["inertia"] < rows[0]["inertia"]
    # Held still, a pose is answered as if nothing had moved before it.
    moving, resting = (roll_out(model, tube_dress(), m).positions for m in (motions[0], motions[0].cut(0, 1)))
    held = roll_out(model, tube_dress(), motions[0], quasi_static=True).positions
    np.testing.assert_allclose(held[0], resting[0], atol=1e-5)
    assert np.abs(held - moving).max() > 1e-4


def test_without_inertia_no_past_is_asked_for():
    bare = replace(SMALL, terms=("strain", "gravity"))
    trainer = Trainer("dynamic", tube_dress(), [swaying(9)], steps=2, seed=1, recipe=bare)
    assert "inertia" not in trainer.step(0)


def test_swinging_motions_turn_stop_and_go_on_without_a_jump():
    given = [swaying(80), swaying(70, name="other", degrees=15.0)]
    clips = make_mixed_clips(given, 600, turn=0.1, lifted=0.5, seed=0)
    motion = make_swinging_motion(clips, "swing", seed=3)
    again = make_swinging_motion(clips, "swing", seed=3)
    np.testing.assert_array_equal(motion.poses, again.poses)
    assert not np.array_equal(motion.poses[:20], make_swinging_motion(clips, "swing", seed=4).poses[:20])
    speeds = joint_speeds(motion)
    held = (speeds == 0.0).all(1)
    lengths = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], held, [0]]))))[::2]
    assert len(lengths) >= len(clips) // 2 and 10 < lengths.max() <= HELD_FRAMES
    # A stop is one; the way on from it is a motion of half a second, however far the next pose is.
    assert np.rad2deg(speeds.max()) < 2 * 180 * 30 / TRANSITION_FRAMES
    steps = np.linalg.norm(np.diff(motion.translations, axis=0), axis=1)
    fastest = max(np.linalg.norm(np.diff(c.translations, axis=0), axis=1).max() for c in clips)
    assert steps.max() < SPEEDS[1] * fastest + 0.02
    assert motion_rates(motion)[:, 7].std() > 0.3  # the pelvis turns [rad/s]


def test_no_body_turns_about_between_two_swinging_clips():
    still = Motion("still", np.zeros((60, 24, 3)), np.zeros((60, 3)))
    clips = [turn_about_vertical(still, angle) for angle in (0.0, np.pi, 0.5, -2.5, 1.5)]
    pelvis = motion_rates(make_swinging_motion(clips, "swing", seed=1))[:, 7]  # [rad/s] about y
    assert np.abs(pelvis).max() < 1.01 * np.deg2rad(2 * np.pi * MAX_DEGREE_HERTZ)


def test_half_of_the_swinging_clips_are_pieces_of_given_motions_and_none_where_none_is_given():
    clips = [swaying(60, name=f"mixed_{number}") for number in range(60)]
    poses = np.zeros((90, 24, 3))
    poses[:, JOINT["left_elbow"], 1] = 1.0
    given = [Motion("given", poses, np.zeros((90, 3)))]

    def bent(side, **options):
        elbow = make_swinging_motion(clips, "swing", seed=2, **options).poses[:, JOINT[f"{side}_elbow"], 1]
        return float((np.abs(elbow) > 0.999).mean())

    assert bent("left") == bent("right") == 0.0
    assert bent("left", originals=given) > 0.1 < bent("right", originals=given)  # mirrored half of the time
    ways = TRANSITION_FRAMES / 80
    assert 0.35 < bent("left", originals=given) + bent("right", originals=given) + 0.5 * ways < 0.65


def test_swinging_clips_of_a_share_are_those_of_mixed_clips_and_the_first_of_more():
    given = [swaying(80), swaying(70, name="other")]
    three, one = (make_shared_clips(given, share, vertices=150, swinging=True) for share in (3, 1))
    assert [m.name for m in three] == ["swinging_0", "swinging_1", "swinging_2"]
    np.testing.assert_array_equal(one[0].poses, three[0].poses)
    assert 1.0 < sum(m.frames for m in three) / (3 * 150) < 2.0
    assert make_shared_clips(given[:1], 0, vertices=150, swinging=True) == []
    assert (
        len(make_shared_clips([swaying(10)], 8, vertices=150, swinging=True)) >= 1
    )  # of few frames some parts


def test_a_pretraining_brings_the_network_to_the_simulated_offsets():
    motions = [swaying(40), swaying(36, name="other", degrees=15.0)]
    dressed, random = tube_dress(), np.random.default_rng(0)
    way, made = 0.03 * random.normal(size=(dressed.vertices, 3)), []
    for motion in motions:
        turn = torch.as_tensor(motion_rates(motion)[:, 6 + 3 * RATED_JOINTS.index("spine1") + 2])  # [rad/s]
        made.append(torch.einsum("t,vi->tvi", turn, torch.as_tensor(way)).float())
    known = {m.name: dressed.skinned(m, smoothing=SMALL.smoothing, offsets=o) for m, o in zip(motions, made)}
    apart = []
    for steps in (0, 150, 150):
        recipe = replace(SMALL, pretraining=steps)
        trainer = Trainer("dynamic", dressed, motions, steps=1, seed=1, recipe=recipe, trajectories=known)
        with torch.no_grad():
            offsets = trainer.network(trainer.data.features[:, None])[0][:, 0]
        apart.append(float((offsets - torch.cat(made)).square().mean()))
    assert apart[1] < 0.1 * apart[0] and apart[2] == apart[1]  # and the same again
    assert trainer.pretraining_seconds > 0 and all(p.grad is None for p in trainer.network.parameters())
