"""How training on a CPU lays out vertices: configurations of one mesh side by side, in vector registers.

Vertices (N, T, V, 3) of N windows of T frames lie in memory as (V, 3, T, N). That is the layout in which a
matrix product gives the network's offsets, and every kernel (skinning, energies, contact) takes it as it is:
the innermost loop runs over LANES configurations. The tensors' shape stays (N, T, V, 3), so whatever has no
kernel works on them too.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

LANES = 16


def laid(x: Tensor) -> np.ndarray:
    """(N, T, ...) -> (..., C, LANES) with C = ceil(T N / LANES), time first: a view of x where it lies so.

    Lanes beyond the last configuration repeat it.
    """
    rows = x.detach().permute(*range(2, x.dim()), 1, 0).flatten(-2)
    missing = -rows.shape[-1] % LANES
    if missing:
        rows = torch.cat([rows, rows[..., -1:].expand(*rows.shape[:-1], missing)], -1)
    return rows.contiguous().unflatten(-1, (-1, LANES)).numpy()


def unlaid(lanes: np.ndarray, windows: int, frames: int) -> Tensor:
    """The inverse of `laid`: (..., C, LANES) -> (N, T, ...), a view."""
    rows = torch.from_numpy(lanes).flatten(-2)[..., : windows * frames].unflatten(-1, (frames, windows))
    return rows.permute(-1, -2, *range(rows.dim() - 2))
