"""The physical terms. Each file holds one: its formula, its definition in torch, its closed-form kernels.

A new term is one file and one line in ALL; the derivative tests pick it up.
"""

from .bend_hinge import BendHinge
from .contact_penalty import ContactPenalty
from .energy import Energy, Step
from .gravity import Gravity
from .inertia import Inertia
from .stretch_spring import StretchSpring
from .stretch_stvk import StretchStVK

ALL: tuple[type[Energy], ...] = (StretchStVK, StretchSpring, BendHinge, Gravity, Inertia, ContactPenalty)

__all__ = [
    "ALL",
    "BendHinge",
    "ContactPenalty",
    "Energy",
    "Gravity",
    "Inertia",
    "Step",
    "StretchSpring",
    "StretchStVK",
]
