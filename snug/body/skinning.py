"""Linear blend skinning in torch, batched and differentiable.

Rotations follow the SMPL convention: the rotation of a joint is relative to its parent joint, and all
frames are parallel to the world in the rest pose. Leading axes `...` broadcast.
"""

from collections.abc import Sequence

import torch
from torch import Tensor


def joint_transforms(
    rotations: Tensor, joints: Tensor, parents: Sequence[int], translations: Tensor
) -> Tensor:
    """Return the rigid transforms (..., J, 3, 4) that take points of each joint from rest to the posed body.

    With rotations R_j (..., J, 3, 3) relative to the parent and rest joints p_j (..., J, 3) [m], the
    world rotation is W_j = W_parent R_j, the posed joint q_j = q_parent + W_parent (p_j - p_parent), and
    the transform x -> W_j (x - p_j) + q_j. The root is at q_0 = p_0 + translation (..., 3) [m]; its
    parent is -1, and parents come before their children.
    """
    world: list[Tensor] = []
    posed: list[Tensor] = []
    for joint, parent in enumerate(parents):
        rotation, rest = rotations[..., joint, :, :], joints[..., joint, :]
        if parent < 0:
            world.append(rotation)
            posed.append(rest + translations)
        else:
            offset = rest - joints[..., parent, :]
            world.append(world[parent] @ rotation)
            posed.append(posed[parent] + (world[parent] @ offset[..., None])[..., 0])
    turn = torch.stack(world, dim=-3)
    shift = torch.stack(posed, dim=-2) - (turn @ joints[..., None])[..., 0]
    return torch.cat([turn, shift[..., None]], dim=-1)


def add_pose_correctives(
    points: Tensor, directions: Tensor, transforms: Tensor, parents: Sequence[int]
) -> Tensor:
    """Add the pose correctives of transforms (..., J, 3, 4) to points (..., P, 3) [m] of the rest pose.

    directions: (P, 3, 9 K) [m], see snug.body.parametric_body.Body; the rotations of joints 1 to K
    relative to their parents are read back from the transforms.
    """
    count = directions.shape[2] // 9
    world = transforms[..., :3]
    bases = world[..., list(parents[1 : count + 1]), :, :]
    relative = bases.transpose(-1, -2) @ world[..., 1 : count + 1, :, :]
    entries = (relative - torch.eye(3, dtype=world.dtype, device=world.device)).flatten(-3)
    return points + (entries @ directions.flatten(0, 1).T).unflatten(-1, (-1, 3))


def skin(points: Tensor, weights: Tensor, transforms: Tensor) -> Tensor:
    """Pose points (..., V, 3) [m] by linear blend skinning, x_i = sum_j w_ij T_j p_i.

    weights: (V, J), rows sum to one. transforms: (..., J, 3, 4) of `joint_transforms`.

    >>> lift = torch.cat([torch.eye(3), torch.tensor([[0.0], [1.0], [0.0]])], dim=1)[None]
    >>> skin(torch.zeros(2, 3), torch.ones(2, 1), lift)
    tensor([[0., 1., 0.],
            [0., 1., 0.]])
    """
    blended = _blend(weights, transforms)
    # Row by row: that many products of a matrix and a vector take a GPU several times as long.
    return (blended[..., :3] * points[..., None, :]).sum(-1) + blended[..., 3]


def unskin(posed: Tensor, weights: Tensor, transforms: Tensor) -> Tensor:
    """Invert `skin`: return the points (..., V, 3) [m] of the rest pose that it takes to `posed`."""
    blended = _blend(weights, transforms)
    return torch.linalg.solve(blended[..., :3], (posed - blended[..., 3])[..., None])[..., 0]


def _blend(weights: Tensor, transforms: Tensor) -> Tensor:
    """Return the blended transform (..., V, 3, 4) of each vertex."""
    return (weights @ transforms.flatten(-2)).unflatten(-1, (3, 4))
