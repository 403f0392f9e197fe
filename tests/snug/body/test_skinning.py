"""Skinning against its invariants."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from snug.body.skinning import joint_transforms, skin
from snug.kernels.skinning import FastSkin

PARENTS = [-1, 0, 1, 1]


def random_tensor(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape))


def rotations_of(turns: torch.Tensor) -> torch.Tensor:
    """(..., 3) [rad] -> (..., 3, 3), by scipy."""
    matrices = Rotation.from_rotvec(turns.reshape(-1, 3).numpy()).as_matrix()
    return torch.from_numpy(matrices).reshape(*turns.shape, 3)


def test_chain_against_homogeneous_matrices():
    """The textbook product of 4x4 matrices, G_j = G_parent [R_j | p_j - p_parent], then G_j [I | -p_j]."""
    rotations = rotations_of(random_tensor(4, 3))
    joints, translation = random_tensor(4, 3, seed=1), random_tensor(3, seed=2)
    world: list[np.ndarray] = []
    for joint, parent in enumerate(PARENTS):
        local = np.eye(4)
        local[:3, :3] = rotations[joint].numpy()
        local[:3, 3] = (
            joints[joint] + translation if parent < 0 else joints[joint] - joints[parent]
        ).numpy()
        world.append(local if parent < 0 else world[parent] @ local)
    transforms = joint_transforms(rotations, joints, PARENTS, translation)
    for joint, matrix in enumerate(world):
        unpose = np.eye(4)
        unpose[:3, 3] = -joints[joint].numpy()
        np.testing.assert_allclose(transforms[joint].numpy(), (matrix @ unpose)[:3], atol=1e-14)


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
