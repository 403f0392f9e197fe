"""Declaration of a term's fast kernels, their forms, and how a solver or a training finds them.

The class attribute `kernels` of an `Energy` has, by use, a function of the term that gives

    vertex_weights  (V,) [N] of a constant pull along -y: early-stopped L-BFGS, block descent, XPBD
    float32_lanes   kernels.lanes.Float32Lanes: early-stopped L-BFGS, and the start of LBFGS
    vertex_block    VertexBlocks: vertex block descent
    constraint      Constraints: XPBD
    training_batch  BatchKernel: the loss of trainings on a CPU

Where one is missing, a solver with a slower way says so once (`warn_slow_path`); the others refuse the
term.

Gauss-Seidel sweeps (vertex block descent, XPBD) move vertices between one element and the next, so their
kernels work on one element at a time, in float64. Training on a CPU evaluates one mesh in some fifty
configurations, so each element is worked out for LANES of them at once, in float32 and in the
layout of snug.kernels.skinning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from reference_sim.energies.energy import Energy
    from reference_sim.energies.inertia import Inertia
    from reference_sim.potential import Potential


class SlowPathWarning(UserWarning):
    """A term has no fast kernel, so that a slower way is taken."""


def has_kernel(term: Energy, use: str) -> bool:
    """Return whether the class of the term declares a kernel; what a parent class declares does not count.

    A subclass may compute something else: one that does not says `kernels = Parent.kernels`.
    """
    return use in vars(type(term)).get("kernels", {})


def fast_kernel(term: Energy, use: str) -> Any:
    """Return what the term's function for this use gives, or None if it declares none."""
    return type(term).kernels[use](term) if has_kernel(term, use) else None


@dataclass(frozen=True)
class StepTerms:
    """The terms of a time step, for solvers that build in what belongs to single vertices."""

    inertia: Inertia
    weighing: tuple[Energy, ...]  # declare "vertex_weights"
    weights: np.ndarray  # (V,) [N] of all of these
    elements: tuple[Energy, ...]  # all other terms, in the order of the potential
    kernels: tuple[Any, ...]  # of each element term


def step_terms(potential: Potential, use: str, solver: str) -> StepTerms:
    """Return the terms of the potential with their kernels for this use.

    Raises ValueError for a term without a kernel for `solver`, or no inertia.
    """
    for term in terms_without_kernel(potential, use):
        raise ValueError(
            f"{solver} has no kernel for the term {term.name!r}: use newton or lbfgs, or declare one "
            "(docs/extend.md, An energy)"
        )
    inertia: Any = next((e for e in potential.energies if e.name == "inertia"), None)
    if inertia is None:
        raise ValueError(f"{solver} takes steps in time: the potential needs inertia")
    weighing = [e for e in potential.energies if has_kernel(e, "vertex_weights")]
    weights = [fast_kernel(term, "vertex_weights") for term in weighing]
    elements = tuple(term for term in potential.energies if has_kernel(term, use))
    return StepTerms(
        inertia=inertia,
        weighing=tuple(weighing),
        weights=sum(weights[1:], weights[0]) if weights else np.zeros(potential.cloth.vertex_count),
        elements=elements,
        kernels=tuple(fast_kernel(term, use) for term in elements),
    )


def terms_without_kernel(potential: Potential, use: str) -> list[Energy]:
    """Return the terms that a solver of time steps with kernels for this use could not take."""
    return [
        e for e in potential.energies
        if e.name != "inertia" and not (has_kernel(e, "vertex_weights") or has_kernel(e, use))
    ]  # fmt: skip


def warn_slow_path(asker: str, kernel: str, terms: Sequence[Energy], instead: str) -> None:
    """Say once per process which terms lack a kernel, and what is done instead."""
    names = ", ".join(dict.fromkeys(type(term).__name__ for term in terms))
    _warn_once(f"{asker}: no {kernel} of {names}: {instead}")


@cache
def _warn_once(message: str) -> None:
    warnings.warn(message, SlowPathWarning, stacklevel=4)


SCRATCH_SHAPE = (4, 3)  # numbers that the kernel of a vertex block may use for its own


@dataclass(frozen=True)
class VertexBlocks:
    """A term as vertex block descent takes it: what the function for "vertex_block" returns.

    kernel: compiled function (data, x, v, g, H, scratch) -> 0.0, which adds the gradient (3,) [N] and a
    convex Hessian block (3, 3) [N/m] of vertex v at x (V, 3) [m] to g and H. data is (first, corners,
    *arrays): corner c of element e is e k + c, and v has corners[first[v] : first[v + 1]].
    """

    kernel: Any
    stencils: np.ndarray  # (N, k) vertices of the elements
    used: np.ndarray  # (N, k) corners that the element depends on
    freeze: Callable[[], tuple[Any, ...]]  # gives `arrays`, as the step has them


@dataclass(frozen=True)
class Constraints:
    """A term as XPBD takes it: what the function for "constraint" returns.

    kernel: compiled function (data, x, w) -> 0.0, which solves one constraint after the other and moves
    x (V, 3) [m] in place; w (V,) [m/N] is dt^2 over the mass. A multiplier is a force: the paper's
    lambda / dt^2.
    """

    kernel: Any
    freeze: Callable[[], tuple[Any, ...]]  # gives `data` as the step has it, with multipliers of zero


LANES = 16  # float32 numbers that a kernel works on side by side, so many of whatever they belong to
# No assumption on NaN or infinity: the guard of training must see them.
GUARDED = {"reassoc", "contract", "nsz"}

# x (C, V, 3, LANES) float32 [m] -> values (C, LANES) [J]; the second argument is like
# x, and the gradients [N] are added to it. The function for "training_batch" returns one.
BatchKernel = Callable[[np.ndarray, np.ndarray], np.ndarray]


def batch_kernel(kernel: Any, stencils: np.ndarray, *constants: Any) -> BatchKernel:
    """Bind a compiled function (x, stencils, *constants, values, gradients) of flat arrays to an energy."""
    # For a signed index is first asked whether it counts from the end.
    stencils = stencils.astype(np.uint32)

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        values = np.empty((len(x), LANES), np.float32)
        kernel(x.ravel(), stencils, *constants, values, gradients.ravel())
        return values

    return run
