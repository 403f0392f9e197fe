"""Layout of the kernels of training on a CPU: float32, TRAINING_LANES configurations side by side.

Training evaluates one mesh in some fifty configurations, so each element is worked out for TRAINING_LANES of
them at once: the innermost loop has a fixed length and no branch, and the compiler turns it into vector
instructions. Vertices (N, T, V, 3) of N windows of T frames lie in memory as C blocks of TRAINING_LANES
frames, (C, V, 3, TRAINING_LANES): the first frames of all windows, then the second ones, and so on
(snug.kernels.lanes). The kernels lie beside the definitions of their terms (`training_batch.py`);
tests/snug/training/test_device.py holds them to the definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

TRAINING_LANES = 16
# No assumption on NaN or infinity: the guard of training must see them.
GUARDED = {"reassoc", "contract", "arcp", "nsz"}

# x (C, V, 3, TRAINING_LANES) float32 [m] -> values (C, TRAINING_LANES) [J]; the second argument is like x,
# and the gradients [N] are added to it. A function that a term names as "training_batch" returns one.
BatchKernel = Callable[[np.ndarray, np.ndarray], np.ndarray]


def batch_kernel(kernel: Any, stencils: np.ndarray, *constants: Any) -> BatchKernel:
    """Bind a compiled function (x, stencils, *constants, values, gradients) of flat arrays to an energy."""
    stencils = stencils.astype(np.uint32)  # for a signed index is first asked whether it counts from the end

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        values = np.empty((len(x), TRAINING_LANES), np.float32)
        kernel(x.ravel(), stencils, *constants, values, gradients.ravel())
        return values

    return run
