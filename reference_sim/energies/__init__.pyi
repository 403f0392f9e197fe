from .bend_hinge import BendHinge as BendHinge
from .contact_barrier import ContactBarrier as ContactBarrier
from .contact_friction import ContactFriction as ContactFriction
from .contact_penalty import ContactPenalty as ContactPenalty
from .energy import Energy as Energy
from .energy import Step as Step
from .gravity import Gravity as Gravity
from .inertia import Inertia as Inertia
from .stretch_spring import StretchSpring as StretchSpring
from .stretch_stvk import StretchStVK as StretchStVK

__all__ = [
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
