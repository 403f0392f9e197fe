"""`snug.skinning.skin` in closed form for many frames of one garment: what training on a CPU runs.

Each vertex hangs on a few joints, and its transform is blended from those alone, for snug.lanes.LANES frames
at a time; the derivative blends it again, which takes less time than to keep it. tests/test_skinning.py holds
values and gradients to `skin`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.kernel_cache import njit
from snug.lanes import LANES, laid, unlaid


class JointWeights:
    """Skinning weights (V, J) without their zeros: joints and values (K,) of vertex v from starts[v] on."""

    def __init__(self, weights: Tensor) -> None:
        vertices, joints = weights.cpu().nonzero(as_tuple=True)
        counts = np.bincount(vertices.numpy(), minlength=len(weights))
        self.starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
        self.joints = joints.numpy().astype(np.uint32)
        self.values = weights[vertices, joints].numpy().astype(np.float32)


class FastSkin(torch.autograd.Function):
    """apply(points (N, T, V, 3) [m], weights, transforms (N, T, J, 3, 4)) -> (N, T, V, 3) [m], float32.

    Differentiable once, by the points alone.
    """

    @staticmethod
    def forward(ctx: Any, points: Tensor, weights: JointWeights, transforms: Tensor) -> Tensor:
        ctx.weights, ctx.transforms = weights, laid(transforms.flatten(-2))
        rest = laid(points)
        posed = np.empty_like(rest)
        _posed(rest, weights.starts, weights.joints, weights.values, ctx.transforms, posed)
        return unlaid(posed, *points.shape[:2])

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> Any:
        weights, forces = ctx.weights, laid(above[0])
        back = np.empty_like(forces)
        _turned_back(forces, weights.starts, weights.joints, weights.values, ctx.transforms, back)
        return unlaid(back, *above[0].shape[:2]), None, None


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _blended(
    starts: np.ndarray,
    joints: np.ndarray,
    values: np.ndarray,
    transforms: np.ndarray,
    v: int,
    block: int,
    b: np.ndarray,
) -> None:
    """The transforms (12, LANES) of vertex v, from those of all joints (J, 12, C, LANES)."""
    b[:] = 0.0
    for k in range(starts[v], starts[v + 1]):
        joint, weight = joints[k], values[k]
        for entry in range(12):
            for n in range(LANES):
                b[entry, n] += weight * transforms[joint, entry, block, n]


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _posed(
    points: np.ndarray,
    starts: np.ndarray,
    joints: np.ndarray,
    values: np.ndarray,
    transforms: np.ndarray,
    out: np.ndarray,
) -> None:
    b = np.empty((12, LANES), np.float32)
    for block in range(points.shape[2]):
        for v in range(len(points)):
            _blended(starts, joints, values, transforms, v, block, b)
            for c in range(3):
                for n in range(LANES):
                    out[v, c, block, n] = (
                        b[4 * c, n] * points[v, 0, block, n]
                        + b[4 * c + 1, n] * points[v, 1, block, n]
                        + b[4 * c + 2, n] * points[v, 2, block, n]
                        + b[4 * c + 3, n]
                    )


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _turned_back(
    above: np.ndarray,
    starts: np.ndarray,
    joints: np.ndarray,
    values: np.ndarray,
    transforms: np.ndarray,
    out: np.ndarray,
) -> None:
    """Gradients by the points: the transpose of each rotation part."""
    b = np.empty((12, LANES), np.float32)
    for block in range(above.shape[2]):
        for v in range(len(above)):
            _blended(starts, joints, values, transforms, v, block, b)
            for c in range(3):
                for n in range(LANES):
                    out[v, c, block, n] = (
                        b[c, n] * above[v, 0, block, n]
                        + b[4 + c, n] * above[v, 1, block, n]
                        + b[8 + c, n] * above[v, 2, block, n]
                    )
