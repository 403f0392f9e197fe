"""The terms of a potential by kind, for solvers that have a kernel of their own for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reference_sim.energies import BendHinge, ContactPenalty, Energy, Gravity, Inertia, StretchStVK
    from reference_sim.potential import Potential

# By the names of the classes: a term that the potential does not have is not even imported.
KINDS = {
    "Inertia": "inertia", "Gravity": "gravity", "StretchStVK": "strain", "BendHinge": "bending",
    "ContactPenalty": "contact",
}  # fmt: skip


@dataclass(frozen=True)
class Terms:
    """The terms of a potential by kind; None where it has no such term."""

    inertia: Inertia
    gravity: Gravity | None
    strain: StretchStVK | None
    bending: BendHinge | None
    contact: ContactPenalty | None


def terms_of(potential: Potential, solver: str) -> Terms:
    """The terms of a potential. Raises ValueError naming the one that `solver` has no kernel for."""
    found: dict[str, Energy | None] = dict.fromkeys(KINDS.values())
    for energy in potential.energies:
        kind = KINDS.get(type(energy).__name__)
        if kind is None or found[kind] is not None:
            raise ValueError(f"{solver} has no kernel for the term {energy.name!r}: use newton or lbfgs")
        found[kind] = energy
    if found["inertia"] is None:
        raise ValueError(f"{solver} takes steps in time: the potential needs inertia")
    return Terms(**found)  # type: ignore[arg-type]


def has_kernels(potential: Potential) -> bool:
    """Whether `terms_of` knows all of them."""
    try:
        terms_of(potential, "")
    except ValueError:
        return False
    return True
