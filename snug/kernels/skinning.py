"""Skinning of many frames of one garment in closed form, for training on a CPU.

The transforms of all vertices are one matrix product, laid out like the vertices (snug.kernels.lanes), so
that the loops become vector instructions. tests/snug/body/test_skinning.py compares values and gradients with
`snug.body.skinning.skin`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.training_lanes import TRAINING_LANES
from reference_sim.kernels.vector_rows import copy_lanes
from snug.kernels.gru import product
from snug.kernels.lanes import from_lanes, to_lanes


class FastSkin(torch.autograd.Function):
    """apply(points (N, T, V, 3) [m], weights (V, J), transforms (N, T, J, 3, 4)) -> (N, T, V, 3) [m].

    In float32, differentiable once, by the points alone, which lie in memory as FastLinear lays its results.
    """

    @staticmethod
    def forward(ctx: Any, points: Tensor, weights: Tensor, transforms: Tensor) -> Tensor:
        """Return the posed points."""
        entries = torch.from_numpy(to_lanes(transforms.flatten(-2)))  # (C, J, 12, TRAINING_LANES)
        entries = entries.movedim(1, -1).flatten(0, 2)
        ctx.blended = product(weights, entries).view(len(weights), -1, 12 * TRAINING_LANES).numpy()
        columns = points.detach().permute(2, 3, 1, 0).flatten(2)  # (V, 3, T N)
        columns = nn.functional.pad(columns, (0, -columns.shape[2] % TRAINING_LANES)).contiguous()
        posed = np.empty((ctx.blended.shape[1], len(weights), 3, TRAINING_LANES), np.float32)
        _posed(columns.numpy().ravel(), ctx.blended, posed.ravel())
        return from_lanes(posed, *points.shape[:2])

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[Tensor, None, None]:
        """Return the gradient by the points."""
        windows, frames, vertices, _ = above[0].shape
        back = np.empty((vertices, 3, ctx.blended.shape[1], TRAINING_LANES), np.float32)
        _turned_back(to_lanes(above[0]).ravel(), ctx.blended, back.ravel())
        columns = torch.from_numpy(back).flatten(2)[..., : frames * windows]
        return columns.unflatten(2, (frames, windows)).permute(3, 2, 0, 1), None, None


# The point is copied into one small array of known size, for the compiler then knows that nothing overlaps.
@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _posed(points: np.ndarray, blended: np.ndarray, out: np.ndarray) -> None:
    """Pose flat points (V, 3, C, L) by blended (V, C, 12 L) into flat out (C, V, 3, L), L lanes."""
    L, (vertices, blocks, _) = TRAINING_LANES, blended.shape
    u = np.empty(3 * L, np.float32)
    for v in range(vertices):
        for block in range(blocks):
            b = blended[v, block]
            for axis in range(3):
                copy_lanes(points, (3 * v + axis) * blocks + block, u, axis)
            for n in range(L):
                x, y, z = u[n], u[L + n], u[2 * L + n]
                u[n] = b[n] * x + b[L + n] * y + b[2 * L + n] * z + b[3 * L + n]
                u[L + n] = b[4 * L + n] * x + b[5 * L + n] * y + b[6 * L + n] * z + b[7 * L + n]
                u[2 * L + n] = b[8 * L + n] * x + b[9 * L + n] * y + b[10 * L + n] * z + b[11 * L + n]
            for axis in range(3):
                copy_lanes(u, axis, out, 3 * (vertices * block + v) + axis)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _turned_back(above: np.ndarray, blended: np.ndarray, out: np.ndarray) -> None:
    """Compute the gradients by the points, laid out like these: the transpose of each rotation part."""
    L, (vertices, blocks, _) = TRAINING_LANES, blended.shape
    u = np.empty(3 * L, np.float32)
    for v in range(vertices):
        for block in range(blocks):
            b = blended[v, block]
            for axis in range(3):
                copy_lanes(above, 3 * (vertices * block + v) + axis, u, axis)
            for n in range(L):
                x, y, z = u[n], u[L + n], u[2 * L + n]
                u[n] = b[n] * x + b[4 * L + n] * y + b[8 * L + n] * z
                u[L + n] = b[L + n] * x + b[5 * L + n] * y + b[9 * L + n] * z
                u[2 * L + n] = b[2 * L + n] * x + b[6 * L + n] * y + b[10 * L + n] * z
            for axis in range(3):
                copy_lanes(u, axis, out, (3 * v + axis) * blocks + block)
