"""The physical terms. Each file holds one: its formula, its definition in torch, its closed-form kernels.

A new term is one file and one line in HOME. A term's file is imported when its name is first used, so that a
scene without contact never loads contact.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .area_barrier import AreaBarrier
    from .barrier_friction import BarrierFriction
    from .bend_hinge import BendHinge
    from .contact_barrier import ContactBarrier
    from .contact_friction import ContactFriction
    from .contact_penalty import ContactPenalty
    from .energy import Energy, Step
    from .gravity import Gravity
    from .inertia import Inertia
    from .stretch_spring import StretchSpring
    from .stretch_stvk import StretchStVK

HOME = {
    "StretchStVK": "stretch_stvk",
    "StretchSpring": "stretch_spring",
    "BendHinge": "bend_hinge",
    "Gravity": "gravity",
    "Inertia": "inertia",
    "ContactPenalty": "contact_penalty",
    "ContactFriction": "contact_friction",
    "ContactBarrier": "contact_barrier",
    "BarrierFriction": "barrier_friction",
    "AreaBarrier": "area_barrier",
    "Energy": "energy",
    "Step": "energy",
}

__all__ = [
    "HOME",
    "AreaBarrier",
    "BarrierFriction",
    "BendHinge",
    "ContactBarrier",
    "ContactFriction",
    "ContactPenalty",
    "Energy",
    "Gravity",
    "Inertia",
    "Step",
    "StretchSpring",
    "StretchStVK",
]


def __getattr__(name: str) -> type:
    if name not in HOME:
        raise AttributeError(f"reference_sim.energies has no term {name!r}: choose one of {', '.join(HOME)}")
    return getattr(import_module(f".{HOME[name]}", __name__), name)
