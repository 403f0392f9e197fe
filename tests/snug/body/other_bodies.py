"""Bodies that are not the package's, made by code from it: other mesh, layout, pose and shape."""

import dataclasses

import igl
import numpy as np

from snug.body.parametric_body import Body
from snug.body.skeleton import PARENTS

SMPL_FACES = 13776  # 6890 vertices


def child(body: Body) -> Body:
    """The body shrunk to 70 % of its size, a little shorter still."""
    size = np.array([0.7, 0.63, 0.7])
    return dataclasses.replace(
        body, template=body.template * size, joint_template=body.joint_template * size
    )


def other_mesh(body: Body, faces: int = SMPL_FACES) -> Body:
    """Edges collapsed to so many faces; weights and shapes from the closest points of the body."""
    points, triangles, *_ = igl.decimate(body.template, body.faces.astype(np.int64), faces)
    _, nearest, closest = igl.point_mesh_squared_distance(
        points, body.template, body.faces.astype(np.int64)
    )
    corners = body.faces[nearest]
    shares = igl.barycentric_coordinates(closest, *(body.template[corners[:, k]] for k in range(3)))
    shares = np.clip(shares, 0.0, None)
    shares /= shares.sum(axis=1, keepdims=True)

    def carried(values: np.ndarray) -> np.ndarray:
        return np.einsum("vk,vk...->v...", shares, values[corners])

    return dataclasses.replace(
        body,
        template=points,
        shape_directions=carried(body.shape_directions),
        skinning_weights=carried(body.skinning_weights),
        faces=triangles.astype(np.int64),
    )


def smpl_arrays(body: Body) -> dict[str, np.ndarray]:
    """In SMPL's layout, with a regressor that gives the body's joints exactly."""
    known = np.concatenate([body.template[..., None], body.shape_directions], axis=2)
    joints = np.concatenate([body.joint_template[..., None], body.joint_directions], axis=2)
    regressor = np.linalg.lstsq(
        known.reshape(len(body.template), -1).T, joints.reshape(24, -1).T, rcond=None
    )[0].T
    table = np.stack([np.array(PARENTS), np.arange(24)]).astype(np.uint32)  # the root's -1 is 2^32 - 1
    return {
        "v_template": body.template,
        "shapedirs": body.shape_directions,
        "J_regressor": regressor,
        "weights": body.skinning_weights,
        "kintree_table": table,
        "f": body.faces.astype(np.uint32),
    }


def with_hands(arrays: dict[str, np.ndarray], face: bool) -> dict[str, np.ndarray]:
    """SMPL-H's layout, 52 joints, or with jaw and eyes SMPL-X's, 55: weights of hand and head are shared out.

    Five fingers of three joints hang on each wrist; their knuckles' mean is SMPL's joint of the hand.
    """
    regressor, weights = arrays["J_regressor"], arrays["weights"]
    parents = list(PARENTS[:22])
    joints, shares = list(regressor[:22]), [*weights[:, :22].T]
    if face:
        head = shares[15] / 4
        shares[15] = head
        parents += [15, 15, 15]
        joints += [regressor[15]] * 3
        shares += [head] * 3
    for wrist, hand in ((20, 22), (21, 23)):
        for finger in range(5):
            first = len(parents)
            parents += [wrist, first, first + 1]
            bone = 0.1 * (regressor[hand] - regressor[wrist])
            joints += [regressor[hand] + (finger - 2 + k) * bone for k in range(3)]
            shares += [weights[:, hand] / 15] * 3
    table = np.stack([np.array(parents), np.arange(len(parents))]).astype(np.uint32)
    return {
        **arrays,
        "J_regressor": np.stack(joints),
        "weights": np.stack(shares, 1),
        "kintree_table": table,
    }


def plain_arrays(body: Body) -> dict[str, np.ndarray]:
    """Without shapes, under plain names."""
    return {
        "vertices": body.template,
        "faces": body.faces,
        "blend_weights": body.skinning_weights,
        "joints": body.joint_template,
        "parents": body.parents,
    }


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
