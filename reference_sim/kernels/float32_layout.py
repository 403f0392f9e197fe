"""Layout of the kernels of early-stopped L-BFGS: float32, LANES_FLOAT32 elements at a time.

A state is u (3V,), the displacement [m] from a point x_0 that float64 has: differences of positions are taken
there once a step, in float64, and each element keeps its own. So round-off is that of a displacement of
millimetres and not of a body metres away.

Elements come in blocks of LANES_FLOAT32; the last one is filled up with elements of no stiffness. Arrays of a
block lie one quantity after the other, each LANES_FLOAT32 wide, so that the loops over lanes become vector
instructions. The kernels lie beside the definitions of their terms;
tests/reference_sim/minimise/test_compiled.py holds values and gradients to the definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from reference_sim.kernels.kernel_cache import njit

LANES_FLOAT32 = 16
SCRATCH = 24 * LANES_FLOAT32  # numbers that a kernel may use for its own
FAST = {"nnan", "nsz", "reassoc", "contract", "arcp"}
TINY = np.float32(1e-30)
HALF, ONE, TWO, THREE = np.float32(0.5), np.float32(1.0), np.float32(2.0), np.float32(3.0)


@dataclass(frozen=True)
class Float32Lanes:
    """A term as `CompiledLBFGS` takes it: what the function for "float32_lanes" returns.

    Attributes:
        gradient: compiled function (data, u, gradient, scratch) -> energy [J] at u (3V,) [m], which adds to
            gradient (3V,) [N]; u, gradient and scratch (SCRATCH,) are float32.
        freeze: function of x_0 (V, 3) [m], called once a step; returns `data`, a tuple of arrays and numbers.
        stiffness: compiled function ((*data, places), values), which adds to the values of the preconditioner
            a scalar stiffness [N/m] that differs from step to step; None where there is none.
        stencils: (S, k) vertices that `stiffness` couples; places (B, k k LANES_FLOAT32) are theirs, -1 where
            nothing is stored.
    """

    gradient: Any
    freeze: Callable[[np.ndarray], tuple[Any, ...]]
    stiffness: Any = None
    stencils: np.ndarray | None = None


def to_blocks(values: np.ndarray) -> np.ndarray:
    """Lay numbers (N, k) of N elements out in blocks (B, k LANES_FLOAT32), filled up with zeros."""
    count, width = values.shape
    padded = np.zeros((-(-count // LANES_FLOAT32) * LANES_FLOAT32, width), values.dtype)
    padded[:count] = values
    return np.ascontiguousarray(padded.reshape(-1, LANES_FLOAT32, width).transpose(0, 2, 1)).reshape(
        -1, width * LANES_FLOAT32
    )


def lay_out(stencils: np.ndarray, *constants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 3 times the vertices of stencils (N, k), and constants (N,) or (N, ...), both in blocks."""
    columns = np.concatenate([c.reshape(len(c), prod(c.shape[1:])) for c in constants], axis=1)
    # Unsigned, for a signed index is first asked whether it counts from the end.
    return to_blocks(3 * stencils.astype(np.uint32)), to_blocks(columns.astype(np.float32))


def empty_state(vertices: np.ndarray, quantities: int) -> np.ndarray:
    """Return room for so many float32 quantities of each element of these blocks."""
    return np.zeros((len(vertices), quantities * LANES_FLOAT32), np.float32)


@njit(cache=True)
def set_edges(x, vertices, columns, out):
    """Write the edges x_(k+1) - x_0, k < columns, of each element into out.

    They are taken from x (V, 3) float64 [m]. With L for LANES_FLOAT32: vertices (B, k L), 3 times the vertex;
    out (B, 3 columns L) float32.
    """
    for b in range(len(vertices)):
        for g in range(LANES_FLOAT32):
            first = vertices[b, g] // 3
            for k in range(columns):
                other = vertices[b, (k + 1) * LANES_FLOAT32 + g] // 3
                for i in range(3):
                    out[b, (3 * k + i) * LANES_FLOAT32 + g] = np.float32(x[other, i] - x[first, i])
