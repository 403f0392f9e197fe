"""Places on a body that garments are cut and measured by: rest joints, and the skin that follows them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from snug.body.parametric_body import Body

TORSO_BONES = ("pelvis", "left_hip", "right_hip", "spine1", "spine2", "spine3", "left_collar", "right_collar")
# Joints whose weights a shirt may borrow: never hands, head or shins, even where they come near.
SHIRT_BONES = (*TORSO_BONES, "left_shoulder", "right_shoulder")
ARM_BONES = ("left_shoulder", "left_elbow")
LEG_BONES = ("left_hip", "left_knee")
CROTCH_BONES = ("pelvis", "left_hip", "right_hip")


def skin_following(body: Body, names: Sequence[str]) -> NDArray[np.bool_]:
    """Return which body vertices (B,) have one of the joints `names` as their strongest skinning weight."""
    wanted = [body.joint_names.index(name) for name in names]
    return np.isin(np.argmax(body.skinning_weights, axis=1), wanted)


def joint_position(body: Body, name: str) -> NDArray[np.float64]:
    """Return the rest position (3,) [m] of the joint called `name`."""
    return np.asarray(body.joint_template, dtype=np.float64)[body.joint_names.index(name)]
