"""Energy terms from the flags of `python -m reference_sim.simulate`, and flags that contradict each other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from reference_sim.cloth import Cloth
from reference_sim.command.simulate_inputs import BadInput
from reference_sim.energies.bend_hinge.definition import BendHinge
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk.definition import StretchStVK

if TYPE_CHECKING:
    from argparse import Namespace

# Other terms are loaded where the flags ask for them.

PENALTY_FLAGS = ("contact_stiffness", "contact_margin", "contact_samples")
BARRIER_FLAGS = ("barrier_distance", "barrier_stiffness")


def check_terms(options: Namespace) -> None:
    """Raise BadInput where flags ask for what they cannot have, with the remedy."""
    barrier = options.barrier or options.self_contact
    penalty = options.obstacle is not None and not options.barrier
    penalty_only = ["--contact-" + name for name in _given(options, PENALTY_FLAGS)]
    penalty_only += ["--friction"] * bool(options.friction)
    barrier_only = ["--barrier-" + name for name in _given(options, BARRIER_FLAGS)]
    if options.obstacle is None:
        if options.obstacle_rest:
            raise BadInput("--obstacle-rest needs an --obstacle")
        if options.barrier:
            raise BadInput("--barrier needs an --obstacle; without one give --self-contact")
        if penalty_only:
            raise BadInput(f"{penalty_only[0]} needs an --obstacle")
    if barrier and not penalty and penalty_only:
        raise BadInput(f"{penalty_only[0]} belongs to the penalty, which a barrier replaces: leave it out")
    if barrier_only and not barrier:
        raise BadInput(f"{barrier_only[0]} needs --barrier or --self-contact")


def make_terms(cloth: Cloth, options: Namespace) -> list[Energy]:
    """Return the terms of Phi in the order of the tables.

    Raises:
        ValueError: the package of a barrier is missing.
    """
    angles = "rest" if options.rest_angles == "rest" else 0.0
    declared: list[Energy] = [
        StretchStVK(cloth),
        BendHinge(cloth, scaling=options.bending_scaling, rest_angles=angles),
        Gravity(cloth),
    ]
    if options.area_barrier:
        from reference_sim.energies.area_barrier import AreaBarrier

        declared.append(AreaBarrier(cloth, stiffness=options.area_barrier))
    if options.obstacle and not options.barrier:
        declared += _penalty(cloth, options)
    if options.barrier or options.self_contact:
        declared.append(_barrier(cloth, options))
    return declared


def _penalty(cloth: Cloth, options: Namespace) -> list[Energy]:
    from reference_sim.energies.contact_friction import ContactFriction
    from reference_sim.energies.contact_penalty.definition import ContactPenalty

    contact = ContactPenalty(cloth, **_given(options, PENALTY_FLAGS))
    friction = [ContactFriction(contact, coefficient=options.friction)] if options.friction else []
    return [contact, *friction]


def _barrier(cloth: Cloth, options: Namespace) -> Energy:
    from reference_sim.energies.contact_barrier import ContactBarrier

    beside_penalty = options.obstacle is not None and not options.barrier
    try:
        contact = ContactBarrier(
            cloth,
            self_contact=options.self_contact,
            obstacle=not beside_penalty,
            **_given(options, BARRIER_FLAGS),
        )
    except ImportError as error:
        raise ValueError(str(error)) from None
    return contact


def _given(options: Namespace, names: Iterable[str]) -> dict[str, Any]:
    """Return what was given of these flags, by what stands behind the first word of their names."""
    given = {name.partition("_")[2]: getattr(options, name) for name in names}
    return {name: value for name, value in given.items() if value is not None}
