"""Layout of vertices in training on a CPU: TRAINING_LANES frames of a batch side by side in memory.

Vertices (N, T, V, 3) of N windows of T frames lie in memory as C blocks of TRAINING_LANES frames,
(C, V, 3, TRAINING_LANES): the first frames of all windows, then the second ones, and so on. Skinning writes
this layout and the kernels of the energies and of contact take it as it is: their innermost loop runs over
the lanes. For TRAINING_LANES windows, as training has, the tensor is a view of it, for most other numbers a
copy. Its shape is (N, T, V, 3) in any case, so terms without a kernel work on it too.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from reference_sim.kernels.fast_kernels import TRAINING_LANES


def to_lanes(x: Tensor) -> np.ndarray:
    """Lay out (N, T, ...) as (C, ..., TRAINING_LANES); lanes beyond the last frame repeat it.

    C = ceil(T N / TRAINING_LANES).
    """
    x = x.detach().transpose(0, 1)
    if x.shape[1] % TRAINING_LANES:
        rows = x.flatten(0, 1)
        x = torch.cat([rows, rows[-1:].expand(-len(rows) % TRAINING_LANES, *rows.shape[1:])])[None]
    return x.unflatten(1, (-1, TRAINING_LANES)).movedim(2, -1).flatten(0, 1).contiguous().numpy()


def from_lanes(lanes: np.ndarray, windows: int, frames: int) -> Tensor:
    """Return (C, ..., TRAINING_LANES) as (N, T, ...), the inverse of `to_lanes`."""
    apart = windows % TRAINING_LANES == 0  # then no block holds frames of two times
    x = torch.from_numpy(lanes).unflatten(0, (frames if apart else 1, -1)).movedim(-1, 2).flatten(1, 2)
    if not apart:
        x = x[0, : frames * windows].unflatten(0, (frames, windows))
    return x.transpose(0, 1)
