"""How training on a CPU lays out vertices: TRAINING_LANES frames of a batch side by side in vector registers.

Vertices (N, T, V, 3) of N windows of T frames lie in memory as C blocks of TRAINING_LANES frames, (C, V, 3, TRAINING_LANES):
the first frames of all windows, then the second ones, and so on. Skinning writes this layout and the kernels
of the energies and of contact take it as it is: their innermost loop runs over the lanes. Of TRAINING_LANES windows,
as training has, the tensor is a view of it, of most other numbers a copy. Its shape is (N, T, V, 3) in any
case, and whatever has no kernel works on it too.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from reference_sim.kernels.training_lanes import TRAINING_LANES


def laid(x: Tensor) -> np.ndarray:
    """(N, T, ...) -> (C, ..., TRAINING_LANES), C = ceil(T N / TRAINING_LANES); lanes beyond the last frame repeat it."""
    x = x.detach().transpose(0, 1)
    if x.shape[1] % TRAINING_LANES:
        rows = x.flatten(0, 1)
        x = torch.cat([rows, rows[-1:].expand(-len(rows) % TRAINING_LANES, *rows.shape[1:])])[None]
    return x.unflatten(1, (-1, TRAINING_LANES)).movedim(2, -1).flatten(0, 1).contiguous().numpy()


def unlaid(lanes: np.ndarray, windows: int, frames: int) -> Tensor:
    """The inverse of `laid`: (C, ..., TRAINING_LANES) -> (N, T, ...)."""
    apart = windows % TRAINING_LANES == 0  # then no block holds frames of two times
    x = torch.from_numpy(lanes).unflatten(0, (frames if apart else 1, -1)).movedim(-1, 2).flatten(1, 2)
    if not apart:
        x = x[0, : frames * windows].unflatten(0, (frames, windows))
    return x.transpose(0, 1)
