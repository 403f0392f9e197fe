"""Planes that cut a garment out of an offset surface."""

import dataclasses

import numpy as np

from snug.garments.cuts import neck_cut
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
