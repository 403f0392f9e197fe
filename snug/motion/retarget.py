"""Put a foreign skeleton's motion on ours: joints matched by name, limbs pointing where theirs do.

Our joint j turns in the world by G_j = G_b A_j. Theirs turns by G_b from the zero pose, and A_j turns our
resting limb t_j into theirs there, d_b: its far end then points along G_b A_j t_j = G_b d_b. How a limb
is twisted about itself follows from its hinge where the file has one. Else A_j is the smallest turn, and
the zero pose must be a T or A pose.

Limbs are matched with ours by common names; the pelvis is where the legs meet, the spine leads from there
to where the arms meet, and the neck from there to the head.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from snug.body.skeleton import JOINT, JOINT_NAMES, PARENTS, REST_JOINTS, axis_angles, rotation_matrices
from snug.motion.motion import MotionError

# Joints whose limb points to the next joint.
LIMBS = {
    f"{side}_{joint}": f"{side}_{child}"
    for side in ("left", "right")
    for joint, child in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
}
FEET = {"left_ankle": "left_foot", "right_ankle": "right_foot"}
# Axis about which a hinge bends in our rest pose. The limb above a hinge is aligned by the same axis.
HINGES = {
    "left_knee": (1, 0, 0),
    "right_knee": (1, 0, 0),
    "left_elbow": (0, -1, 0),
    "right_elbow": (0, 1, 0),
}
# Largest turn from our rest pose to a zero pose without hinges: legs astride, arms down.
ASTRIDE, ARMS_DOWN = np.deg2rad(60.0), np.deg2rad(95.0)


def retarget(
    turns: Mapping[str, np.ndarray],
    directions: Mapping[str, np.ndarray],
    hinges: Mapping[str, np.ndarray],
) -> np.ndarray:
    """Return our poses (T, 24, 3) [rad] relative to the parents; a joint that they lack does not turn.

    By our joint: `turns` (T, 3, 3) in the world from their zero pose; in that pose, y up and facing +z,
    `directions` (3,) of LIMBS and of FEET where there are any, and axes (3,) of HINGES or none at all.

    Raises:
        MotionError: a limb has no direction, or the zero pose is no T or A pose.
    """
    rotations = np.empty((len(turns["pelvis"]), len(JOINT_NAMES), 3, 3))
    for joint, name in enumerate(JOINT_NAMES):
        if name in turns:
            rotations[:, joint] = turns[name] @ _alignment(name, directions, hinges)
        else:
            rotations[:, joint] = rotations[:, PARENTS[joint]]
    relative = rotations.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            relative[:, joint] = np.swapaxes(rotations[:, parent], -1, -2) @ rotations[:, joint]
    return axis_angles(relative)


def _alignment(
    name: str, directions: Mapping[str, np.ndarray], hinges: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Return A (3, 3) of one joint.

    Feet turn about the vertical only, since both skeletons stand flat in their rest poses. Spine, head
    and collars have no limb to align: upright is upright.
    """
    side, _, part = name.partition("_")
    if part in ("wrist", "hand"):
        return _alignment(f"{side}_elbow", directions, hinges)
    if part in ("ankle", "foot") and f"{side}_ankle" in directions:
        theirs = directions[f"{side}_ankle"]
        ours = REST_JOINTS[JOINT[f"{side}_foot"]] - REST_JOINTS[JOINT[f"{side}_ankle"]]
        yaw = np.arctan2(theirs[0], theirs[2]) - np.arctan2(ours[0], ours[2])
        return rotation_matrices(np.array([0.0, yaw, 0.0]))
    if name not in LIMBS:
        return np.eye(3)
    ours, theirs = REST_JOINTS[JOINT[LIMBS[name]]] - REST_JOINTS[JOINT[name]], directions[name]
    hinge = f"{side}_{'knee' if part in ('hip', 'knee') else 'elbow'}"
    if hinges:
        turn = _frame(theirs, hinges[hinge]) @ _frame(ours, np.array(HINGES[hinge], dtype=float)).T
    else:
        axis = np.cross(ours, theirs)
        sine = np.linalg.norm(axis)
        angle = np.arctan2(sine, ours @ theirs)
        if angle > (ASTRIDE if hinge.endswith("knee") else ARMS_DOWN):
            raise MotionError(
                f"its zero pose is no T or A pose: {name} is turned by {np.degrees(angle):.0f} "
                "degrees; export it with a T pose at rest"
            )
        turn = rotation_matrices(axis * (angle / sine)) if sine > 0.0 else np.eye(3)
    if not np.isfinite(turn).all() or not theirs.any():
        raise MotionError(f"{name} has no length, or lies along its own hinge; export it again")
    return turn


def _frame(along: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Return orthonormal columns: along, the part of hinge across it, and their cross product."""
    first = along / np.linalg.norm(along)
    second = hinge - first * (first @ hinge)
    second /= np.linalg.norm(second)
    return np.stack((first, second, np.cross(first, second)), axis=1)


# Joints of a side, from the trunk outwards; those of NEEDED a skeleton must have.
LIMB_CHAINS = (("hip", "knee", "ankle", "foot"), ("collar", "shoulder", "elbow", "wrist", "hand"))
NEEDED = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
# What common skeletons call them: after joints (ours, Biovision), or after bones (Mixamo, CMU's clips as
# BVH, Unity, Unreal, 3ds Max, Daz). Arms and legs are each named in the style that fits best.
STYLES: tuple[dict[str, tuple[str, ...]], ...] = (
    {joint: (joint,) for limb in LIMB_CHAINS for joint in limb}
    | {"ankle": ("ankle", "foot"), "foot": ("toe", "toes", "foot"), "wrist": ("wrist", "hand")},
    {
        "hip": ("upleg", "upperleg", "thigh"), "knee": ("leg", "lowleg", "lowerleg", "shin", "calf"),
        "ankle": ("foot",), "foot": ("toebase", "toe", "toes", "toe0", "ball"),
        "collar": ("shoulder", "collar", "clavicle"), "shoulder": ("arm", "uparm", "upperarm", "shldr"),
        "elbow": ("forearm", "lowarm", "lowerarm"), "wrist": ("hand",), "hand": (),
    },
)  # fmt: skip
SIDES = ("left", "right")
SIDE_WORDS = {"l": "left", "left": "left", "r": "right", "right": "right"}
_BREAKS = re.compile(r"[\s_.\-]+|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def match_joints(names: Sequence[str], parents: Sequence[int]) -> dict[str, int]:
    """Return our joint names with the indices of their joints; optional ones that they lack are left out.

    End sites have an empty name. Parents come first, that of the root is -1.

    Raises:
        MotionError: a needed joint is missing; names it.
    """
    matches = _limbs(names)
    for ours in (f"{side}_{joint}" for side in SIDES for joint in NEEDED):
        if ours not in matches:
            listing = ", ".join(filter(None, names))
            raise MotionError(
                f"no joint is known as '{ours}'; rename it in the file (there are {listing[:300]})"
            )
    return _trunk(names, parents, matches) | matches


def _limbs(names: Sequence[str]) -> dict[str, int]:
    """Return the joints of legs and arms, each in the style that names most of those needed."""
    sided: dict[tuple[str, str], int] = {}
    for index, name in enumerate(names):
        sided.setdefault(_side(name), index)
    matches: dict[str, int] = {}
    for limb in LIMB_CHAINS:
        guesses: list[dict[str, int]] = []
        for style in STYLES:
            guess: dict[str, int] = {}
            for side, joint in product(SIDES, limb):
                places = [sided[side, base] for base in style[joint] if (side, base) in sided]
                if places and places[0] not in guess.values():  # none stands for two of ours
                    guess[f"{side}_{joint}"] = places[0]
            guesses.append(guess)
        best = max(guesses, key=lambda guess: sum(ours.partition("_")[2] in NEEDED for ours in guess))
        matches.update(best)
    return matches


def _side(name: str) -> tuple[str, str]:
    """Split a name into side and the rest, in small letters.

    Such as "mixamorig:LeftUpLeg", "lThigh", "thigh_l", "Bip01 L Thigh".
    """
    parts = [word.lower() for word in _BREAKS.split(name.rpartition(":")[2]) if word]
    for place, rest in ((0, parts[1:]), (-1, parts[:-1]), (1, parts[2:])):
        if rest and parts[place] in SIDE_WORDS:
            return SIDE_WORDS[parts[place]], "".join(rest)
    return "", "".join(parts)


def _trunk(names: Sequence[str], parents: Sequence[int], matches: Mapping[str, int]) -> dict[str, int]:
    """Match pelvis, spine, neck and head by place; the spine may have any number of joints."""
    pelvis = _meet(parents, matches["left_hip"], matches["right_hip"])
    chest = _meet(parents, matches["left_shoulder"], matches["right_shoulder"])
    head = next((index for index, name in enumerate(names) if _side(name)[1].endswith("head")), None)
    if head is None:
        raise MotionError("no joint is known as 'head'; rename it in the file")
    trunk = {"pelvis": pelvis, "head": head}
    spine = [joint for joint in reversed(way_up(parents, chest)) if pelvis in way_up(parents, joint)[1:]]
    if spine:
        trunk["spine1"] = spine[0]
    if len(spine) > 1:
        trunk["spine3"] = spine[-1]
    if len(spine) > 2:
        trunk["spine2"] = spine[len(spine) // 2]
    neck = [joint for joint in way_up(parents, head)[1:] if chest in way_up(parents, joint)[1:]]
    return trunk | ({"neck": neck[0]} if neck else {})


def way_up(parents: Sequence[int], joint: int) -> list[int]:
    """Return the joint and all above it, upwards."""
    way = [joint]
    while parents[way[-1]] >= 0:
        way.append(parents[way[-1]])
    return way


def _meet(parents: Sequence[int], one: int, other: int) -> int:
    """Return the lowest joint above both."""
    above = set(way_up(parents, other))
    return next(joint for joint in way_up(parents, one) if joint in above)
