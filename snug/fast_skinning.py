"""`snug.skinning.skin` in closed form for many frames of one garment: what training on a CPU runs.

The transforms of all vertices are one matrix product, laid out (12, V) a frame, so that the loop over
vertices is one of vector instructions. tests/test_skinning.py holds values and gradients to `skin`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.kernel_cache import njit
from snug.fast_network import product


class FastSkin(torch.autograd.Function):
    """apply(points (..., V, 3) [m], weights (V, J), transforms (..., J, 3, 4)) -> (..., V, 3) [m], float32.

    Differentiable once, by the points alone.
    """

    @staticmethod
    def forward(ctx: Any, points: Tensor, weights: Tensor, transforms: Tensor) -> Tensor:
        entries = transforms.flatten(-2).transpose(-1, -2).reshape(-1, weights.shape[1])
        blended = product(entries, weights).view(-1, 12, len(weights)).numpy()
        posed = torch.empty_like(points, memory_format=torch.contiguous_format)
        _posed(points.detach().reshape(-1, *points.shape[-2:]).numpy(), blended, _frames(posed))
        ctx.blended = blended
        return posed

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> Any:
        back = torch.empty_like(above[0], memory_format=torch.contiguous_format)
        _turned_back(_frames(above[0].contiguous()), ctx.blended, _frames(back))
        return back, None, None


def _frames(x: Tensor) -> np.ndarray:
    return x.view(-1, *x.shape[-2:]).numpy()


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _posed(points: np.ndarray, blended: np.ndarray, out: np.ndarray) -> None:
    for n in range(len(points)):
        p, b, q = points[n], blended[n], out[n]
        for v in range(len(p)):
            x, y, z = p[v, 0], p[v, 1], p[v, 2]
            for c in range(3):
                q[v, c] = b[4 * c, v] * x + b[4 * c + 1, v] * y + b[4 * c + 2, v] * z + b[4 * c + 3, v]


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _turned_back(above: np.ndarray, blended: np.ndarray, out: np.ndarray) -> None:
    """Gradients by the points: the transpose of each rotation part."""
    for n in range(len(above)):
        g, b, q = above[n], blended[n], out[n]
        for v in range(len(g)):
            x, y, z = g[v, 0], g[v, 1], g[v, 2]
            for c in range(3):
                q[v, c] = b[c, v] * x + b[4 + c, v] * y + b[8 + c, v] * z
