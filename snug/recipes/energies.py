"""Energies of the simulator as terms of the training loss, found by the name that each gives itself.

Whatever `reference_sim.energies` names, and every other subclass of Energy that
has been imported, can be named in `Recipe.terms`, if the rest state of the garment is all that it needs. No
list has to be edited: a term that declares no kernel "training_batch" is trained more slowly, and one line
says so.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator

from reference_sim import energies
from reference_sim.energies import Energy


def find_energy(name: str) -> Callable[..., Energy]:
    """Return the function that makes the energy of that name from a Cloth, its options at their defaults.

    Raises:
        ValueError: an unknown name, one that two have, or an energy that cannot be trained: it is made of
            more than a cloth, must be prepared for each step of a simulation (Energy.prepare), or finds its
            stencils anew as vertices move (Energy.dynamic).

    >>> find_energy("gravity").__name__
    'Gravity'
    """
    for class_name in energies.__all__:
        getattr(energies, class_name)  # imported by it
    terms = [term for term in _subclasses(Energy) if hasattr(term, "name")]
    named = [term for term in terms if term.name == name]
    if not named:
        known = sorted({term.name for term in terms if not _reason_against(term)})
        raise ValueError(
            f"unknown energy {name!r}: use one of {', '.join(known)}, or import the file of your own"
        )
    fit = {(term.__module__, term.__qualname__): term for term in named if not _reason_against(term)}
    if len(fit) > 1:
        places = " and ".join(module for module, _ in fit)
        raise ValueError(f"energy {name!r} is defined in {places}: give yours a name of its own")
    if fit:
        return next(iter(fit.values()))
    raise ValueError(f"energy {name!r} cannot be trained: {_reason_against(named[0])}")


def _subclasses(of: type[Energy]) -> Iterator[type[Energy]]:
    for term in of.__subclasses__():
        yield term
        yield from _subclasses(term)


def _reason_against(term: type[Energy]) -> str:
    """Say why a term cannot be part of a loss; empty if it can."""
    parameters = inspect.signature(term).parameters.values()
    variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    needed = [p.name for p in parameters if p.default is p.empty and p.kind not in variadic]
    if needed != ["cloth"]:
        return f"it is made of {', '.join(needed)}, a garment has its cloth alone"
    if term.prepare is not Energy.prepare:
        return "it must be prepared for each step of a simulation"
    return "its stencils change as vertices move" if term.dynamic else ""
