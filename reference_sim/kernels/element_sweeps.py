"""Layout of the kernels of Gauss-Seidel sweeps in float64: vertex block descent and XPBD.

A sweep moves vertices between one element and the next, so its kernels work on one element at a time, where
the energies' own kernels run over all. They lie beside the definitions of their terms (`sweeps.py`);
tests/benchmarks/methods/test_minimisers.py holds them to the energies' gradients and Hessians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

SCRATCH_SHAPE = (4, 3)  # numbers that the kernel of a vertex block may use for its own


@dataclass(frozen=True)
class VertexBlocks:
    """A term as vertex block descent takes it: what a function returns that a term names as "vertex_block".

    Attributes:
        kernel: compiled function (data, x, v, g, H, scratch) -> 0.0, which adds the gradient (3,) [N] and a
            convex Hessian block (3, 3) [N/m] of vertex v at x (V, 3) [m] to g and H. data is (first, corners,
            *arrays): corner c of element e is e k + c, and those of vertex v are
            corners[first[v] : first[v + 1]].
        stencils: (N, k) vertices of the elements.
        used: (N, k) corners that the element depends on.
        freeze: function that gives `arrays`, as the step has them.
    """

    kernel: Any
    stencils: np.ndarray
    used: np.ndarray
    freeze: Callable[[], tuple[Any, ...]]


@dataclass(frozen=True)
class Constraints:
    """A term as XPBD takes it: what a function returns that a term names as "constraint".

    Attributes:
        kernel: compiled function (data, x, w) -> 0.0, which solves one constraint after the other and moves
            x (V, 3) [m] in place; w (V,) [m/N] is dt^2 over the mass. A multiplier is a force: the paper's
            lambda / dt^2.
        freeze: function that gives `data` as the step has it, with multipliers of zero.
    """

    kernel: Any
    freeze: Callable[[], tuple[Any, ...]]
