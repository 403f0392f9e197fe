"""Planes that cut a garment out of an offset surface: the neck, bends, corners on two cuts."""

import dataclasses

import numpy as np

from snug.garments.cuts import SEAM_CUT, CutPlane, neck_cut, outlines
from snug.garments.templates import find_template


def test_a_neck_is_cut_above_high_shoulders(body):
    """Lower neck joint by 4 cm: then the shoulders are as high beside it as they are on other bodies."""
    joints = body.joint_template.copy()
    joints[body.joint_names.index("neck"), 1] -= 0.04
    low = dataclasses.replace(body, joint_template=joints)
    neck = neck_cut(low, 0.015)
    assert neck.point[1] > joints[body.joint_names.index("neck"), 1] + 0.005
    assert neck_cut(body, 0.015).point[1] == body.joint_template[body.joint_names.index("neck"), 1]
    shirt = find_template("tshirt").tailor(low, vertices=500)
    assert np.abs(shirt.rest_positions[shirt.loops["neck"], 0]).max() < neck.reach - 0.005


def test_a_corner_that_clipping_left_twice_counts_once():
    """A square with a second corner 10 micrometres from one: on both cuts too."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [1e-6, 1, 0], [0, 1, 0], [0, 0.5, 0], [0.5, 1, 0],
                       [0.5, 0, 0], [1, 0.5, 0], [0.5, 0.5, 0]])  # fmt: skip
    ring = [0, 7, 1, 8, 2, 6, 3, 4, 5]
    faces = np.array([[9, a, b] for a, b in zip(ring, np.roll(ring, -1), strict=True)])
    cuts = [
        SEAM_CUT,
        CutPlane("top", (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)),
        CutPlane("side", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        CutPlane("hem", (0.0, -1.0, 0.0), (0.0, 0.0, 0.0)),
    ]
    (loop,) = outlines(points, faces, cuts)
    assert sorted(name for name, _ in loop) == ["hem", "seam", "side", "top"]
