"""Skinning of many frames in closed form, for training on a CPU, and their layout in memory.

Few joints move a vertex, so each adds its share alone. tests/snug/body/test_body.py compares values and
gradients with `snug.body.skinning.skin`.

The loops run over frames that lie side by side. Vertices (N, T, V, 3) of N windows of T frames lie in
memory as C blocks of LANES frames, (C, V, 3, LANES): the first frames of all windows,
then the second ones, and so on. Skinning writes this layout and the kernels of the energies and of
contact take it as it is. For LANES windows, as training has, the tensor is a view of it, for
most other numbers a copy. Its shape is (N, T, V, 3) in any case, so terms without a kernel work on it
too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from reference_sim.kernels.fast_kernels import LANES
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import copy_lanes


def to_lanes(x: Tensor) -> np.ndarray:
    """Lay out (N, T, ...) as (C, ..., LANES); lanes beyond the last frame repeat it.

    C = ceil(T N / LANES).
    """
    x = x.detach().transpose(0, 1)
    if x.shape[1] % LANES:
        rows = x.flatten(0, 1)
        x = torch.cat([rows, rows[-1:].expand(-len(rows) % LANES, *rows.shape[1:])])[None]
    return x.unflatten(1, (-1, LANES)).movedim(2, -1).flatten(0, 1).contiguous().numpy()


def from_lanes(lanes: np.ndarray, windows: int, frames: int) -> Tensor:
    """Return (C, ..., LANES) as (N, T, ...), the inverse of `to_lanes`."""
    whole = windows % LANES == 0  # then no block holds frames of two times
    x = torch.from_numpy(lanes).unflatten(0, (frames if whole else 1, -1)).movedim(-1, 2).flatten(1, 2)
    if not whole:
        x = x[0, : frames * windows].unflatten(0, (frames, windows))
    return x.transpose(0, 1)


class FastSkin(torch.autograd.Function):
    """apply(points (N, T, V, 3) [m], weights (V, J), transforms (N, T, J, 3, 4)) -> (N, T, V, 3) [m].

    In float32, differentiable once, by the points alone, which lie in memory as FastLinear lays its
    results.
    """

    @staticmethod
    def forward(ctx: Any, points: Tensor, weights: Tensor, transforms: Tensor) -> Tensor:
        """Return the posed points."""
        entries = to_lanes(transforms.flatten(-2))  # (C, J, 12, LANES)
        ctx.moving = weights.numpy(), entries.reshape(*entries.shape[:2], -1)
        columns = points.detach().permute(2, 3, 1, 0).flatten(2)  # (V, 3, T N)
        if columns.shape[2] % LANES:
            columns = nn.functional.pad(columns, (0, -columns.shape[2] % LANES))
        posed = np.empty((len(entries), len(weights), 3, LANES), np.float32)
        _pose(columns.contiguous().numpy().ravel(), *ctx.moving, posed.ravel(), False)
        return from_lanes(posed, *points.shape[:2])

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[Tensor, None, None]:
        """Return the gradient by the points: the transpose of each rotation turns that from above."""
        windows, frames, vertices, _ = above[0].shape
        weights, entries = ctx.moving
        turned_back = np.zeros_like(entries)
        source, target = (
            a.reshape(*a.shape[:2], 3, 4, LANES)[..., :3, :] for a in (entries, turned_back)
        )
        target[:] = source.swapaxes(2, 3)
        back = np.empty((vertices, 3, len(entries), LANES), np.float32)
        _pose(to_lanes(above[0]).ravel(), weights, turned_back, back.ravel(), True)
        columns = torch.from_numpy(back).flatten(2)[..., : frames * windows]
        return columns.unflatten(2, (frames, windows)).permute(3, 2, 0, 1), None, None


# Each point is copied into a small array of known size: the compiler then knows that nothing overlaps.
@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _pose(
    points: np.ndarray, weights: np.ndarray, entries: np.ndarray, out: np.ndarray, by_block: bool
) -> None:
    """Pose flat points (V, 3, C, L) by weights (V, J), entries (C, J, 12 L) into flat out (C, V, 3, L).

    by_block: the other way round, from points (C, V, 3, L) into out (V, 3, C, L).
    """
    L, (vertices, joints), blocks = LANES, weights.shape, len(entries)
    u = np.empty(6 * L, np.float32)
    moving = np.empty(joints, np.int64)
    for v in range(vertices):
        count = 0
        for joint in range(joints):
            if weights[v, joint] != np.float32(0.0):
                moving[count] = joint
                count += 1
        for block in range(blocks):
            # Place of the first axis, and what lies between two axes.
            vertexwise, blockwise = (3 * v * blocks + block, blocks), (3 * (vertices * block + v), 1)
            source, target = (blockwise, vertexwise) if by_block else (vertexwise, blockwise)
            for axis in range(3):
                copy_lanes(points, source[0] + source[1] * axis, u, axis)
            u[3 * L :] = np.float32(0.0)
            for m in range(count):
                w, b = weights[v, moving[m]], entries[block, moving[m]]
                for n in range(L):
                    x, y, z = u[n], u[L + n], u[2 * L + n]
                    u[3 * L + n] += w * (b[n] * x + b[L + n] * y + b[2 * L + n] * z + b[3 * L + n])
                    u[4 * L + n] += w * (
                        b[4 * L + n] * x + b[5 * L + n] * y + b[6 * L + n] * z + b[7 * L + n]
                    )
                    u[5 * L + n] += w * (
                        b[8 * L + n] * x + b[9 * L + n] * y + b[10 * L + n] * z + b[11 * L + n]
                    )
            for axis in range(3):
                copy_lanes(u, 3 + axis, out, target[0] + target[1] * axis)
