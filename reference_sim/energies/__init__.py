"""Physical terms, a file or a folder each: formula with its source, definition in torch, kernels.

In a folder, `definition.py` has the formula and the kernels in float64, and every other file the kernels of
one use (kernels.fast_kernels). A new term is one file, its line in MODULE_OF and its import for type
checkers. The file is imported when the term's name is first used: a scene without contact loads none.

>>> from reference_sim import Cloth
>>> from reference_sim.energies import StretchStVK
>>> cloth = Cloth([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]], [[0, 2, 1]])
>>> value, gradient = StretchStVK(cloth).value_and_gradient(1.1 * cloth.rest_positions)
>>> round(value, 4), gradient.shape  # J; N at each vertex
(0.0035, (3, 3))
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reference_sim.energies.area_barrier import AreaBarrier as AreaBarrier
    from reference_sim.energies.bend_hinge.definition import BendHinge as BendHinge
    from reference_sim.energies.contact_barrier import ContactBarrier as ContactBarrier
    from reference_sim.energies.contact_friction import ContactFriction as ContactFriction
    from reference_sim.energies.contact_penalty.definition import ContactPenalty as ContactPenalty
    from reference_sim.energies.energy import Energy as Energy
    from reference_sim.energies.energy import Step as Step
    from reference_sim.energies.gravity import Gravity as Gravity
    from reference_sim.energies.inertia import Inertia as Inertia
    from reference_sim.energies.stretch_spring import StretchSpring as StretchSpring
    from reference_sim.energies.stretch_stvk.definition import StretchStVK as StretchStVK

MODULE_OF = {
    "StretchStVK": "stretch_stvk.definition",
    "StretchSpring": "stretch_spring",
    "BendHinge": "bend_hinge.definition",
    "Gravity": "gravity",
    "Inertia": "inertia",
    "ContactPenalty": "contact_penalty.definition",
    "ContactFriction": "contact_friction",
    "ContactBarrier": "contact_barrier",
    "AreaBarrier": "area_barrier",
    "Energy": "energy",
    "Step": "energy",
}

__all__ = list(MODULE_OF)


def __getattr__(name: str) -> type:
    if name not in MODULE_OF:
        raise AttributeError(
            f"reference_sim.energies has no term {name!r}: choose one of {', '.join(MODULE_OF)}"
        )
    return getattr(import_module(f".{MODULE_OF[name]}", __name__), name)
