"""Self-contact of a scene's cloth: a barrier beside the declared terms, and starts that leave it a choice.

No method is measured by the barrier: it is a term of the simulation alone. Contact with the body stays the
scene's own, and gives way where the body leaves less room than two layers of cloth need: there cloth goes
into the body, never through itself (see reference_sim.energies.contact_barrier).
"""

from __future__ import annotations

import numpy as np

from reference_sim.energies.contact_barrier import ContactBarrier
from reference_sim.energies.energy import Energy

DISTANCE, STIFFNESS = 1e-3, 100.0  # [m], two thicknesses of the cloth; [Pa]


def with_self_contact(energies: tuple[Energy, ...]) -> tuple[Energy, ...]:
    """Return the terms and the barrier of their cloth against itself.

    Raises:
        ImportError: ipctk is not installed.
        ValueError: a triangle of the mesh is less than DISTANCE high; the message names it.
    """
    return (*energies, ContactBarrier(energies[0].cloth, distance=DISTANCE, stiffness=STIFFNESS))


def demand_uncrossed(x: np.ndarray, energies: tuple[Energy, ...], name: str) -> None:
    """Raise ValueError where x (V, 3) [m], the start of the cloth called `name`, crosses itself."""
    places = (term.infeasibility(x) for term in energies if term.joins_late)
    if place := next(filter(None, places), ""):
        raise ValueError(
            f"{name}: {place} where it starts: self-contact cannot untangle it; mend the mesh at this face, "
            "or simulate without self-contact"
        )
