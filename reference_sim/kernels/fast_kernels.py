"""Declaration of a term's fast kernels, and how a solver or a training finds them.

An `Energy` names in its class attribute `kernels` what it has, by use (USES): "module:function", or the name
of a function of its own file. The module is imported when a solver asks. Nobody keeps a list of terms. Where
a kernel is missing, a solver with a slower way says so once (`warn_slow_path`); the others refuse the term.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from reference_sim.energies.energy import Energy
    from reference_sim.energies.inertia import Inertia
    from reference_sim.potential import Potential

# Use -> what the named function (term) -> ... gives, and who asks for it.
USES = {
    "vertex_inertia": "(V,) [N/m] of a pull towards term.x_hat: early-stopped L-BFGS, block descent, XPBD",
    "vertex_weights": "(V,) [N] of a constant pull along -y: early-stopped L-BFGS, block descent, XPBD",
    "float32_lanes": "kernels.float32_layout.Float32Lanes: early-stopped L-BFGS, and the start of LBFGS",
    "vertex_block": "kernels.element_sweeps.VertexBlocks: vertex block descent",
    "constraint": "kernels.element_sweeps.Constraints: XPBD",
    "training_batch": "kernels.training_lanes.BatchKernel: the loss of trainings on a CPU",
}
OF_VERTICES = ("vertex_inertia", "vertex_weights")


class SlowPathWarning(UserWarning):
    """A term has no fast kernel, so that a slower way is taken."""


def has_kernel(term: Energy, use: str) -> bool:
    """Return whether the class of the term declares a kernel; what a parent class declares does not count.

    A subclass may compute something else: one that does not says `kernels = Parent.kernels`.

    Raises:
        ValueError: the class declares a use that does not exist.
    """
    declared = vars(type(term)).get("kernels", {})
    if unknown := sorted(set(declared) - set(USES)):
        raise ValueError(
            f"{type(term).__name__}.kernels: unknown use {unknown[0]!r}, choose of {', '.join(USES)}"
        )
    return use in declared


def fast_kernel(term: Energy, use: str) -> Any:
    """Return what the term's function for this use gives, or None if it declares none."""
    kind: Any = type(term)  # hashable, which mypy does not see
    return _function(kind, use)(term) if has_kernel(term, use) else None


@cache
def _function(kind: type[Energy], use: str) -> Callable[[Energy], Any]:
    module, colon, name = kind.kernels[use].rpartition(":")
    return getattr(import_module(module if colon else kind.__module__), name)


@dataclass(frozen=True)
class StepTerms:
    """The terms of a time step, for solvers that build in what belongs to single vertices.

    Attributes:
        inertia: the term that declares "vertex_inertia".
        weighing: terms that declare "vertex_weights"; weights: (V,) [N] of all of them.
        elements: all other terms, in the order of the potential; kernels: what each of them gives.
    """

    inertia: Inertia
    weighing: tuple[Energy, ...]
    weights: np.ndarray
    elements: tuple[Energy, ...]
    kernels: tuple[Any, ...]


def step_terms(potential: Potential, use: str, solver: str) -> StepTerms:
    """Return the terms of the potential with their kernels for this use.

    Raises:
        ValueError: a term without a kernel for `solver`, or no inertia.
    """
    for term in terms_without_kernel(potential, use):
        raise ValueError(
            f"{solver} has no kernel for the term {term.name!r}: use newton or lbfgs, or declare one "
            "(docs/extend.md, An energy)"
        )
    inertia, weighing = ([e for e in potential.energies if has_kernel(e, part)] for part in OF_VERTICES)
    if len(inertia) != 1:
        raise ValueError(f"{solver} takes steps in time: the potential needs inertia, once")
    weights = [fast_kernel(term, "vertex_weights") for term in weighing]
    elements = tuple(term for term in potential.energies if has_kernel(term, use))
    return StepTerms(
        inertia=inertia[0],  # type: ignore[arg-type]
        weighing=tuple(weighing),
        weights=sum(weights[1:], weights[0]) if weights else np.zeros(potential.cloth.vertex_count),
        elements=elements,
        kernels=tuple(fast_kernel(term, use) for term in elements),
    )


def terms_without_kernel(potential: Potential, use: str) -> list[Energy]:
    """Return the terms that a solver of time steps with kernels for this use could not take."""
    return [e for e in potential.energies if not any(has_kernel(e, kind) for kind in (*OF_VERTICES, use))]


def warn_slow_path(asker: str, kernel: str, terms: Sequence[Energy], instead: str) -> None:
    """Say once per process which terms lack a kernel, and what is done instead."""
    names = ", ".join(dict.fromkeys(type(term).__name__ for term in terms))
    _warn_once(f"{asker}: no {kernel} of {names}: {instead}")


@cache
def _warn_once(message: str) -> None:
    warnings.warn(message, SlowPathWarning, stacklevel=4)
