"""A body of a user's file: every layout gives the same body, and what is broken is refused in one line."""

import dataclasses
import pickle

import igl
import numpy as np
import pytest
import torch
from scipy.sparse import csc_matrix
from scipy.spatial.transform import Rotation

from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT, PARENTS, BodyError
from snug.body.skinning import add_pose_correctives, skin
from snug.body.smpl_files import read_body
from tests.reference_sim.meshes import edge_counts, volume


def other_mesh(body: Body, faces: int = 13776) -> Body:
    """Edges collapsed to so many faces, SMPL's; weights and shapes from the closest points of the body."""
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
    basis = np.concatenate([body.template[..., None], body.shape_directions], axis=2)
    joints = np.concatenate([body.joint_template[..., None], body.joint_directions], axis=2)
    regressor = np.linalg.lstsq(
        basis.reshape(len(body.template), -1).T, joints.reshape(24, -1).T, rcond=None
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


@pytest.fixture(scope="module")
def small(body):
    """Another mesh, of 1000 vertices."""
    return other_mesh(body, 1996)


@pytest.fixture(scope="module")
def layouts(small):
    """Return arrays of the body layouts that users have: SMPL, SMPL-H, SMPL-X and plain."""
    smpl = smpl_arrays(small)
    return {
        "SMPL": smpl,
        "SMPL-H": with_hands(smpl, face=False),
        "SMPL-X": with_hands(smpl, face=True),
        "plain": {
            "vertices": small.template,
            "faces": small.faces,
            "blend_weights": small.skinning_weights,
            "joints": small.joint_template,
            "parents": small.parents,
        },
    }


def saved(path, arrays):
    if path.suffix.lower() == ".pkl":
        sparse = {k: csc_matrix(v) if k == "J_regressor" else v for k, v in arrays.items()}
        path.write_bytes(pickle.dumps(sparse, protocol=2))
    else:
        np.savez(path, **arrays)
    return path


@pytest.mark.parametrize("ending", [".npz", ".PKL"])
@pytest.mark.parametrize("layout", ["SMPL", "SMPL-H", "SMPL-X", "plain"])
def test_every_layout_gives_the_same_body(small, layouts, layout, ending, tmp_path):
    user = read_body(saved(tmp_path / f"user{ending}", layouts[layout]))
    np.testing.assert_allclose(user.template, small.template, atol=1e-12)
    np.testing.assert_allclose(user.joint_template, small.joint_template, atol=1e-12)
    np.testing.assert_allclose(user.skinning_weights, small.skinning_weights, atol=1e-12)
    np.testing.assert_array_equal(user.faces, small.faces)
    assert user.parents.tolist() == small.parents.tolist()
    if layout.startswith("SMPL"):
        betas = np.linspace(-1.0, 1.0, 10)
        np.testing.assert_allclose(user.joints(betas), small.joints(betas), atol=1e-12)
        np.testing.assert_allclose(user.rest_vertices(betas), small.rest_vertices(betas), atol=1e-12)
    else:
        assert user.shape_count == 0


def test_pose_correctives_are_what_smpl_says(small, layouts, tmp_path):
    """Rest pose: none. Posed: the rest shape that is skinned has moved by posedirs (R - I)."""
    posedirs = 0.003 * np.random.default_rng(0).normal(size=(len(small.template), 3, 207))
    user = read_body(saved(tmp_path / "a.npz", layouts["SMPL"] | {"posedirs": posedirs}))
    still = np.zeros((1, 24, 3)), np.zeros((1, 3))
    np.testing.assert_allclose(user.vertices(*still)[0], small.template, atol=1e-12)
    poses = np.random.default_rng(1).normal(scale=0.5, size=(2, 24, 3))
    turns = Rotation.from_rotvec(poses[:, 1:].reshape(-1, 3)).as_matrix().reshape(2, 23, 3, 3)
    betas = np.linspace(-1.0, 1.0, 10)
    posed = user.vertices(poses, np.zeros((2, 3)), betas)
    for frame in range(2):
        moved = posedirs @ (turns[frame] - np.eye(3)).ravel()
        corrected = dataclasses.replace(small, template=small.template + moved)
        expected = corrected.vertices(poses[frame : frame + 1], np.zeros((1, 3)), betas)[0]
        np.testing.assert_allclose(posed[frame], expected, atol=1e-12)
    assert np.abs(posed - small.vertices(poses, np.zeros((2, 3)), betas)).max() > 0.01


def test_training_poses_the_body_with_its_correctives(small):
    posedirs = 0.003 * np.random.default_rng(0).normal(size=(len(small.template), 3, 189))
    user = dataclasses.replace(small, pose_directions=posedirs)
    poses = np.random.default_rng(1).normal(scale=0.5, size=(2, 24, 3))
    transforms = torch.as_tensor(user.transforms(poses, np.zeros((2, 3))))
    rest, weights = (torch.as_tensor(a) for a in (user.template, user.skinning_weights))
    rest = add_pose_correctives(rest, torch.as_tensor(posedirs), transforms, user.parents.tolist())
    posed = skin(rest, weights, transforms).numpy()
    np.testing.assert_allclose(posed, user.vertices(poses, np.zeros((2, 3))), atol=1e-12)


def test_correctives_of_fingers_are_left_out(layouts, small, tmp_path):
    posedirs = np.zeros((len(small.template), 3, 459))
    posedirs[:, 0] = np.arange(459)
    user = read_body(saved(tmp_path / "a.npz", layouts["SMPL-H"] | {"posedirs": posedirs}))
    assert user.pose_directions[0, 0].tolist() == list(range(189))


def test_the_eyes_of_a_head_are_closed(small, layouts, tmp_path):
    sides = np.linalg.norm(np.diff(small.template[small.faces[:, [0, 1, 2, 0]]], axis=1), axis=2).sum(
        axis=1
    )
    reach = np.bincount(small.faces.ravel(), np.repeat(sides, 3))
    around = (small.faces == np.argmin(reach)).any(axis=1)
    user = read_body(saved(tmp_path / "a.npz", layouts["SMPL"] | {"f": small.faces[~around]}))
    assert volume(user.template, user.faces) == pytest.approx(
        volume(small.template, small.faces), rel=0.01
    )
    assert np.all(edge_counts(user.faces)[2] == 2)


def changed(key, change, layout="SMPL"):
    return lambda layouts: {**layouts[layout], key: change(np.array(layouts[layout][key]))}


def without_feet(layouts):
    arrays = layouts["SMPL"]
    return arrays | {"f": arrays["f"][arrays["v_template"][arrays["f"], 1].min(axis=1) > 0.12]}


ELBOW = np.where(np.arange(24) == 18, 1e6, 1.0)[:, None]
ANKLE = 0.1 * np.outer(np.arange(24) == JOINT["left_ankle"], [1, 0, 0])
BEFORE = 0.11 * np.outer(np.arange(24) == JOINT["left_wrist"], [0, 0, 1])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (changed("weights", lambda w: 2 * w), "sum to one"),
        (changed("v_template", lambda v: v * 1000), "in metres"),
        (changed("v_template", lambda v: v * [-1, 1, -1]), "face +z"),
        (changed("v_template", lambda v: v + np.array([0.5, 0, 0])), "beside x = 0"),
        (changed("J_regressor", lambda r: r * ELBOW), "left_elbow"),
        (changed("kintree_table", lambda t: np.full((2, 24), 30)), "hangs on 30"),
        (without_feet, "a hole at vertex"),
        (changed("f", lambda f: f[:, ::-1]), "inside out"),
        (changed("f", lambda f: np.where(f == 5, -1, f.astype(int))), "f names vertex -1"),
        (changed("joints", lambda j: j + ANKLE, "plain"), "left leg is 10 degrees off the T pose"),
        (changed("joints", lambda j: j + BEFORE, "plain"), "left arm is 13 degrees off the T pose"),
    ],
    ids=range(11),
)
def test_a_broken_body_is_refused_in_one_line(layouts, tmp_path, change, says):
    path = saved(tmp_path / "broken.npz", change(layouts))
    with pytest.raises(BodyError) as caught:
        read_body(path)
    message = str(caught.value)
    assert says in message and str(path) in message and "\n" not in message
