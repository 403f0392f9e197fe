"""Fixed ensemble of the reference: simulations as valid as it, whose spread is its uncertainty.

The members and their number are the same in every run, so that an uncertainty does not depend on how many
simulations a run happened to make. Three members cost three further simulations of each motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

# Family and level of each member: a start perturbed by 1e-4 m, contact planes searched twice in each step, a
# tolerance a hundred times tighter. A simulation with another time step is none: it solves another problem.
MEMBERS = {
    "simulation-perturbed-1e-4": ("simulation-perturbed", 1e-4),
    "simulation-refrozen": ("simulation-refrozen", None),
    "simulation-1e-8": ("simulation-tolerance", 1e-8),
}
LEAST_MEMBERS = 2  # of which a spread is taken


def is_member(family: str, level: float | None) -> bool:
    """Return whether methods of that family and level belong to the ensemble.

    >>> is_member("simulation-refrozen", None), is_member("simulation-perturbed", 1e-9)
    (True, False)
    """
    return (family, level) in MEMBERS.values()


def spread(changes: Iterable[float]) -> float | None:
    """Return the standard deviation (n - 1) of a number over the reference and the members of its ensemble.

    Args:
        changes: by how much each member changes the number when it takes the reference's place.

    Returns:
        The standard deviation in the unit of the changes; None for fewer than LEAST_MEMBERS.

    >>> spread([0.1, -0.1]), spread([0.1])
    (0.1, None)
    """
    values = [0.0, *changes]
    if len(values) <= LEAST_MEMBERS:
        return None
    mean = sum(values) / len(values)
    return math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))
