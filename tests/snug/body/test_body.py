"""The body of the package is a closed adult that poses as SMPL does."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT_NAMES, BodyError
from tests.snug.body.other_bodies import volume


def joint(name: str) -> int:
    return JOINT_NAMES.index(name)


def test_surface_is_closed_and_without_handles(body):
    edges = np.concatenate([body.faces[:, [0, 1]], body.faces[:, [1, 2]], body.faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)  # each edge once in each direction: one winding
    undirected, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    assert np.all(counts == 2)
    assert len(body.template) - len(undirected) + len(body.faces) == 2  # Euler: one sphere
    assert len(np.unique(body.faces)) == len(body.template)


def test_template_is_an_adult(body):
    assert 1.5 < body.height < 1.9
    assert 0.050 < volume(body.template, body.faces) < 0.100
    assert abs(body.template[:, 1].min()) < 0.002  # stands on y = 0
    assert np.abs(body.joint_template[0, [0, 2]]).max() < 1e-6


def test_weights_are_sparse_and_sum_to_one(body):
    assert body.skinning_weights.min() >= 0.0
    np.testing.assert_allclose(body.skinning_weights.sum(axis=1), 1.0, atol=1e-12)
    assert (body.skinning_weights > 0).sum(axis=1).max() <= 8


def test_t_pose_faces_z_with_the_left_arm_along_x(body):
    at = {name: body.joint_template[index] for index, name in enumerate(JOINT_NAMES)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = at[f"{side}_wrist"] - at[f"{side}_shoulder"]
        np.testing.assert_allclose(arm / np.linalg.norm(arm), [sign, 0.0, 0.0], atol=1e-4)
        assert at[f"{side}_foot"][2] - at[f"{side}_ankle"][2] > 0.05  # toes forward
        assert at[f"{side}_hip"][0] * sign > 0.05
    heights = [at[name][1] for name in ("left_ankle", "left_knee", "pelvis", "spine2", "neck", "head")]
    assert np.all(np.diff(heights) > 0)
    mirrored = body.joint_template[[joint(n.replace("left", "right")) for n in JOINT_NAMES if "left" in n]]
    left_joints = body.joint_template[[joint(n) for n in JOINT_NAMES if "left" in n]]
    np.testing.assert_allclose(mirrored * [-1, 1, 1], left_joints, atol=1e-3)


def test_shapes_start_at_the_template_and_the_first_one_is_height(body):
    np.testing.assert_array_equal(body.shaped(np.zeros(10)), body.template)
    np.testing.assert_array_equal(body.joints(np.zeros(10)), body.joint_template)
    tall = np.eye(10)[0]
    gain = np.ptp(body.shaped(tall)[:, 1]) - np.ptp(body.shaped(-tall)[:, 1])
    assert 0.10 < gain < 0.30  # two standard deviations of the height of adults of both sexes
    fat = np.eye(10)[1]
    change = volume(body.shaped(fat), body.faces) / volume(body.shaped(-fat), body.faces)
    assert change > 1.1 and abs(np.ptp(body.shaped(fat)[:, 1]) - np.ptp(body.shaped(-fat)[:, 1])) < 0.03


@pytest.mark.parametrize("seed", range(3))
def test_joints_stay_inside_every_body(body, seed):
    from igl import fast_winding_number

    betas = np.random.default_rng(seed).normal(size=10)
    inside = fast_winding_number(body.shaped(betas), body.faces, body.joints(betas))
    assert inside.min() > 0.5, [JOINT_NAMES[j] for j in np.flatnonzero(inside < 0.5)]


def test_identity_pose_is_the_shaped_body(body):
    betas = np.linspace(-1.0, 1.0, 10)
    shift = np.array([0.1, 0.2, 0.3])
    posed = body.vertices(np.zeros((2, 24, 3)), np.stack([0 * shift, shift]), betas)
    np.testing.assert_allclose(posed[0], body.shaped(betas), atol=1e-13)
    np.testing.assert_allclose(posed[1], body.shaped(betas) + shift, atol=1e-13)


def test_the_root_moves_everything_rigidly_about_the_pelvis(body):
    poses = np.random.default_rng(0).normal(scale=0.4, size=(1, 24, 3))
    poses[:, 0] = 0.0
    turned = poses.copy()
    turned[:, 0] = [0.4, -1.9, 0.7]
    shift = np.array([[0.3, -0.2, 1.0]])
    pelvis = body.joint_template[0]
    turn = Rotation.from_rotvec(turned[0, 0]).as_matrix()
    expected = (body.vertices(poses, 0 * shift)[0] - pelvis) @ turn.T + pelvis + shift
    np.testing.assert_allclose(body.vertices(turned, shift)[0], expected, atol=1e-12)


def test_vertices_agree_with_the_skinning_used_in_training(body):
    import torch

    from snug.body.skinning import joint_transforms, skin

    random = np.random.default_rng(1)
    poses, shifts = random.normal(scale=0.5, size=(70, 24, 3)), random.normal(size=(70, 3))
    betas = random.normal(size=10)
    transforms = joint_transforms(
        torch.from_numpy(Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix()).reshape(*poses.shape, 3),
        torch.from_numpy(body.joints(betas)),
        body.parents.tolist(),
        torch.from_numpy(shifts),
    )
    some = slice(0, None, 97)
    expected = skin(
        torch.from_numpy(body.shaped(betas)[some]), torch.from_numpy(body.skinning_weights[some]), transforms
    )
    np.testing.assert_allclose(body.vertices(poses, shifts, betas)[:, some], expected.numpy(), atol=1e-12)


def test_a_body_posed_frame_after_frame_is_the_same(body):
    rng = np.random.default_rng(4)
    poses, translations = rng.normal(0, 0.5, (5, 24, 3)), rng.normal(0, 1, (5, 3))
    for betas in (None, rng.normal(0, 1, body.shape_count)):
        whole, pose = body.vertices(poses, translations, betas), body.poser(betas)
        for frame in (3, 0):
            one = pose(poses[frame : frame + 1], translations[frame : frame + 1])
            assert np.abs(one - whole[frame]).max() < 1e-12


def test_elbow_and_knee_bend_their_own_side(body):
    """An elbow turned by -90 degrees about y points forward; a knee by +90 about x puts the foot behind."""
    poses = np.zeros((1, 24, 3))
    poses[0, joint("left_elbow"), 1] = -np.pi / 2
    poses[0, joint("left_knee"), 0] = np.pi / 2
    posed = body.vertices(poses, np.zeros((1, 3)))[0]
    moving = [joint(f"left_{name}") for name in ("elbow", "wrist", "hand", "knee", "ankle", "foot")]
    still = body.skinning_weights[:, moving].sum(axis=1) == 0
    assert 1000 < still.sum() < len(still) - 1000
    np.testing.assert_allclose(posed[still], body.template[still], atol=1e-13)
    hand = body.skinning_weights[:, joint("left_hand")] > 0.9
    foot = body.skinning_weights[:, joint("left_foot")] > 0.9
    elbow, knee = body.joint_template[joint("left_elbow")], body.joint_template[joint("left_knee")]
    assert np.all(posed[hand, 2] > elbow[2] + 0.15) and np.abs(posed[hand, 0] - elbow[0]).max() < 0.15
    assert np.all(posed[foot, 2] < knee[2] - 0.3)


def test_lowered_arms_keep_the_volume(body):
    poses = np.zeros((1, 24, 3))
    poses[0, joint("left_shoulder"), 2], poses[0, joint("right_shoulder"), 2] = -1.2, 1.2
    lowered = volume(body.vertices(poses, np.zeros((1, 3)))[0], body.faces)
    assert lowered == pytest.approx(volume(body.template, body.faces), rel=0.02)


@pytest.mark.parametrize(
    ("poses", "translations", "betas"),
    [
        (np.zeros((2, 22, 3)), np.zeros((2, 3)), None),
        (np.zeros((2, 24, 3)), np.zeros((3, 3)), None),
        (np.full((2, 24, 3), np.nan), np.zeros((2, 3)), None),
        (np.zeros((2, 24, 3)), np.zeros((2, 3)), np.zeros(3)),
        (np.zeros((2, 24, 3)), np.zeros((2, 3)), np.full(10, np.inf)),
    ],
)
def test_wrong_arguments_are_refused(body, poses, translations, betas):
    with pytest.raises(BodyError):
        body.vertices(poses, translations, betas)
