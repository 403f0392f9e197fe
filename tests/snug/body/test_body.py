"""The body of the package is a closed adult that poses as SMPL does; skinning against its invariants."""

import igl
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT_NAMES, BodyError
from snug.body.skinning import joint_transforms, skin
from snug.kernels.skinning import FastSkin
from tests.reference_sim.meshes import edge_counts, volume


def joint(name: str) -> int:
    return JOINT_NAMES.index(name)


def test_template_is_an_adult_of_one_closed_surface(body):
    halves, edges, counts = edge_counts(body.faces)
    assert len(np.unique(halves, axis=0)) == len(halves)  # each edge once in each direction: one winding
    assert np.all(counts == 2) and len(np.unique(body.faces)) == len(body.template)
    assert len(body.template) - len(edges) + len(body.faces) == 2  # Euler: one sphere
    assert 1.5 < body.height < 1.9
    assert 0.050 < volume(body.template, body.faces) < 0.100
    assert abs(body.template[:, 1].min()) < 0.002  # stands on y = 0
    assert np.abs(body.joint_template[0, [0, 2]]).max() < 1e-6
    assert body.skinning_weights.min() >= 0.0
    np.testing.assert_allclose(body.skinning_weights.sum(axis=1), 1.0, atol=1e-12)
    assert (body.skinning_weights > 0).sum(axis=1).max() <= 8


def test_shapes_start_at_the_template_and_the_first_one_is_height(body):
    np.testing.assert_array_equal(body.rest_vertices(np.zeros(10)), body.template)
    np.testing.assert_array_equal(body.joints(np.zeros(10)), body.joint_template)
    tall = np.eye(10)[0]
    gain = np.ptp(body.rest_vertices(tall)[:, 1]) - np.ptp(body.rest_vertices(-tall)[:, 1])
    assert 0.10 < gain < 0.30  # two standard deviations of the height of adults of both sexes
    fat, slim = body.rest_vertices(np.eye(10)[1]), body.rest_vertices(-np.eye(10)[1])
    change = volume(fat, body.faces) / volume(slim, body.faces)
    assert change > 1.1 and abs(np.ptp(fat[:, 1]) - np.ptp(slim[:, 1])) < 0.03


def test_joints_stay_inside_every_body(body):
    for betas in np.random.default_rng(0).normal(size=(3, 10)):
        inside = igl.fast_winding_number(body.rest_vertices(betas), body.faces, body.joints(betas))
        assert inside.min() > 0.5, [JOINT_NAMES[j] for j in np.flatnonzero(inside < 0.5)]


def test_vertices_agree_with_the_skinning_used_in_training(body):
    random = np.random.default_rng(1)
    poses, shifts = random.normal(scale=0.5, size=(70, 24, 3)), random.normal(size=(70, 3))
    betas = random.normal(size=10)
    transforms = joint_transforms(
        rotations_of(torch.from_numpy(poses)),
        torch.from_numpy(body.joints(betas)),
        body.parents.tolist(),
        torch.from_numpy(shifts),
    )
    some = slice(0, None, 97)
    expected = skin(
        torch.from_numpy(body.rest_vertices(betas)[some]),
        torch.from_numpy(body.skinning_weights[some]),
        transforms,
    )
    np.testing.assert_allclose(body.vertices(poses, shifts, betas)[:, some], expected.numpy(), atol=1e-12)


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


@pytest.mark.parametrize("poses", [np.zeros((2, 22, 3)), np.full((2, 24, 3), np.nan)])
def test_poses_that_are_none_are_refused(body, poses):
    with pytest.raises(BodyError):
        body.vertices(poses, np.zeros((2, 3)))


def random_tensor(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape))


def rotations_of(turns: torch.Tensor) -> torch.Tensor:
    """(..., 3) [rad] -> (..., 3, 3), by scipy."""
    matrices = Rotation.from_rotvec(turns.reshape(-1, 3).numpy()).as_matrix()
    return torch.from_numpy(matrices).reshape(*turns.shape, 3)


@pytest.mark.parametrize("windows", [2, 16])
def test_closed_form_is_skinning_and_its_derivative(windows):
    points, transforms, above = (
        random_tensor(windows, 3, *s).float() for s in ((50, 3), (4, 3, 4), (50, 3))
    )
    weights = torch.softmax(random_tensor(50, 4), -1).float()
    weights[::2, 1:3] = 0.0  # most joints do not move a vertex
    fast, slow = points.clone().requires_grad_(), points.double().requires_grad_()
    posed = FastSkin.apply(fast, weights, transforms)
    exact = skin(slow, weights.double(), transforms.double())
    posed.backward(above)
    exact.backward(above.double())
    assert torch.allclose(posed.double(), exact, rtol=0, atol=3e-6)  # float32 of sums of size 10
    assert torch.allclose(fast.grad.double(), slow.grad, rtol=0, atol=3e-6) and slow.grad.norm() > 1
