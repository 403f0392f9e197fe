"""A roll-out is the network one frame at a time: in the world, and as long as the motion."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from snug.networks.garment_network import make_network
from snug.networks.roll_out import prepare_frame_inputs, prepare_frames, roll_out
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT
from tests.snug.training.dressing import random_model, swaying, tube_dress

SHAPED = np.array([0.0, 2.0, 0, 0, 0, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("kind", ["snug", "pbns"])
def test_what_came_before_a_motion_is_known_to_inputs_and_state(kind):
    dressed, motion = tube_dress(), swaying()
    model = random_model(kind, dressed, [motion], seed=2)
    whole = roll_out(model, dressed, motion).positions[5:]
    before, rest = motion.cut(0, 5), motion.cut(5, motion.frames)
    begin = prepare_frames(model, dressed, rest, earlier=before)
    for _ in range(2):
        assert np.abs(np.array(list(begin())) - whole).max() < 1e-6
    forgetful = np.array(list(prepare_frames(model, dressed, rest)()))
    assert kind == "pbns" or np.abs(forgetful - whole).max() > 1e-5
    make = prepare_frame_inputs(model, dressed, motion)
    inputs = prepare_frame_inputs(model, dressed, rest, earlier=before)
    assert torch.allclose(inputs(0)[0], make(5)[0], atol=1e-6)


def test_a_quasi_static_frame_forgets_the_past_and_the_velocity():
    dressed, motion = tube_dress(), swaying()
    model = random_model("snug", dressed, [motion], seed=0)
    static = roll_out(model, dressed, motion, quasi_static=True)
    reordered = type(motion)("back", motion.poses[::-1], motion.translations[::-1] * 2.0)
    back = roll_out(model, dressed, reordered, quasi_static=True)
    pelvis, other = dressed.pelvis(motion)[:, None], dressed.pelvis(reordered)[:, None]
    assert np.abs((static.positions - pelvis) - (back.positions - other)[::-1]).max() < 1e-5
    assert np.isnan(static.frame_seconds).all()
    moving = roll_out(model, dressed, motion)
    assert np.abs(moving.positions - static.positions).max() > 1e-5


def test_body_shape_changes_the_roll_out_and_the_network_sees_shapes_it_has_met():
    dressed, motion = tube_dress(), swaying()
    shaped = dressed.skin(motion, SHAPED, smoothing=DEFAULT.smoothing)
    unshaped = dressed.skin(motion, smoothing=DEFAULT.smoothing)
    assert np.abs(shaped - unshaped).max() > 5e-3
    for shapes, least, most in ((3.0, 1e-4, 1.0), (0.0, 0.0, 1e-5)):
        recipe = replace(DEFAULT, shape_range=shapes)
        model = random_model("snug", dressed, [motion], seed=0, recipe=recipe)
        offsets = roll_out(model, dressed, motion, SHAPED).positions - shaped
        plain = roll_out(model, dressed, motion).positions - unshaped
        assert least <= np.abs(offsets - plain).max() < most


def test_misfits_of_vertices_triangles_and_rate_are_named():
    dressed, motion, fast = tube_dress(), swaying(), swaying(fps=60.0)
    snug, pbns = (random_model(kind, dressed, [motion], seed=0) for kind in ("snug", "pbns"))
    other = TrainedModel("snug", make_network("snug", 154, 7, DEFAULT, seed=0), DEFAULT)
    for model, moved, message in (
        (other, motion, "7 vertices, the garment 150"),
        (replace(snug, triangles="another"), motion, "as many vertices and other triangles"),
        (snug, fast, r"learned from 30 frames a second, motion .* has 60: resample"),
    ):
        with pytest.raises(ValueError, match=message):
            roll_out(model, dressed, moved)
    roll_out(pbns, dressed, fast)  # a pose has no rate
