"""How training on a CPU lays out vertices: LANES configurations of one mesh side by side, in vector registers.

Vertices (N, T, V, 3) of N windows of T frames lie in memory as (C, V, 3, LANES): C blocks of LANES frames, the
first frames of all windows before the second ones. Skinning writes this layout and the kernels of the
energies and of contact take it as it is. Their innermost loop runs over the lanes. Of LANES windows, as
training has, the tensor is a view of it; of any other number it is a copy. Its shape is (N, T, V, 3) in any
case, so that whatever has no kernel works on it too.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

LANES = 16


def laid(x: Tensor) -> np.ndarray:
    """(N, T, ...) -> (C, ..., LANES), C = ceil(T N / LANES); lanes beyond the last repeat it."""
    x = x.detach()
    if len(x) == LANES:
        return x.movedim(0, -1).contiguous().numpy()
    rows = x.transpose(0, 1).flatten(0, 1)
    missing = -len(rows) % LANES
    rows = torch.cat([rows, rows[-1:].expand(missing, *rows.shape[1:])])
    return rows.unflatten(0, (-1, LANES)).movedim(1, -1).contiguous().numpy()


def unlaid(lanes: np.ndarray, windows: int, frames: int) -> Tensor:
    """The inverse of `laid`: (C, ..., LANES) -> (N, T, ...)."""
    x = torch.from_numpy(lanes)
    if windows == LANES:
        return x.movedim(-1, 0)
    return x.movedim(-1, 1).flatten(0, 1)[: windows * frames].unflatten(0, (frames, windows)).transpose(0, 1)
