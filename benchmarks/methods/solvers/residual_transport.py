"""Transport of a solver's residual: what it added to a network's frame is carried by the skin to the next.

A network's error changes slowly: cloth that it puts too deep, or hangs too stiffly, is so in the next frame
too. So the next first guess is the network's frame and a share of the last residual, turned as skinning turns
the vertex.
"""

from __future__ import annotations

import numpy as np
from torch import Tensor

from reference_sim.kernels.kernel_cache import njit


class ResidualTransport:
    """Vectors at the vertices of a garment, turned from one frame of a motion to the next.

    Args:
        weights: (V, J) of skinning.
        transforms: (T, J, 3, 4) of the joints, as for `snug.body.skinning.skin`.
    """

    def __init__(self, weights: Tensor, transforms: Tensor) -> None:
        self._weights = weights.numpy()
        self._transforms = transforms.numpy()
        self._last: tuple[int, np.ndarray] = (-1, np.zeros((0, 9)))  # a frame, its blended transforms

    def _blended(self, frame: int) -> np.ndarray:
        """Return the blended linear parts (V, 9) of a frame."""
        linear = self._transforms[frame, :, :, :3].reshape(len(self._transforms[frame]), 9)
        return self._weights @ linear

    def carried(self, residual: np.ndarray, frame: int) -> np.ndarray:
        """Return vectors (V, 3) of frame - 1 as they are in `frame`."""
        before = self._last[1] if self._last[0] == frame - 1 else self._blended(frame - 1)
        after = self._blended(frame)
        self._last = frame, after
        turned = np.empty_like(residual)
        _turn(residual, before, after, turned)
        return turned


@njit(cache=True)
def _turn(vectors: np.ndarray, before: np.ndarray, after: np.ndarray, out: np.ndarray) -> None:
    """Write after before^T v: blends are close to rotations, and their transpose never amplifies."""
    for v in range(len(vectors)):
        for i in range(3):
            out[v, i] = 0.0
        for j in range(3):
            local = 0.0
            for i in range(3):
                local += before[v, 3 * i + j] * vectors[v, i]
            for i in range(3):
                out[v, i] += after[v, 3 * i + j] * local
