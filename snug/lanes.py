"""How training on a CPU lays out vertices: windows of a batch side by side in vector registers.

Vertices (N, T, V, 3) of N windows of T frames lie in memory as (T W, V, 3, LANES), for each frame W blocks of
LANES windows. Skinning writes this layout and the kernels of the energies and of contact take it as it is:
their innermost loop runs over the lanes. Of LANES windows, as training has, the tensor is a view of it, of
any other number a copy. Its shape is (N, T, V, 3) in any case, and whatever has no kernel works on it too.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

LANES = 16


def filled(x: Tensor) -> Tensor:
    """(N, ...) with the last row repeated until rows fill blocks of LANES."""
    missing = -len(x) % LANES
    return torch.cat([x, x[-1:].expand(missing, *x.shape[1:])]) if missing else x


def laid(x: Tensor) -> np.ndarray:
    """(N, T, ...) -> (T W, ..., LANES), W = ceil(N / LANES); lanes beyond the last window repeat it."""
    blocks = filled(x.detach()).unflatten(0, (-1, LANES)).movedim(1, -1)  # (W, T, ..., LANES)
    return blocks.transpose(0, 1).flatten(0, 1).contiguous().numpy()


def unlaid(lanes: np.ndarray, windows: int) -> Tensor:
    """The inverse of `laid`: (T W, ..., LANES) -> (N, T, ...)."""
    blocks = torch.from_numpy(lanes).unflatten(0, (-1, -(-windows // LANES)))  # (T, W, ..., LANES)
    return blocks.movedim(-1, 2).flatten(1, 2)[:, :windows].transpose(0, 1)
