"""Protocol: its number and digests, the ensemble of the reference, and the rules of verdicts of reports.

The number stands for all that a result depends on and that no method brings itself. Two numbers of the
same protocol can stand in one table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from benchmarks.provenance import digest
from benchmarks.results.row import ResultsError

NUMBER = "1.0"
# Part of the protocol -> digest of its definitions. tests/benchmarks/test_protocol.py holds the code to
# them.
DIGESTS = {
    "scenes": "88c6128b67b3dd78",
    "materials": "37f8eb4aecad748b",
    "motions": "dc71f7b3a0e629a9",
    "metrics": "72cc8a3f3e8ba02f",
    "reference": "7c745c22c1ea3e12",
    "sampling": "01a71f93dd349175",
    "statistics": "bbdacc941ceaa26a",
}
DIGEST = digest(DIGESTS)
OWN = "own"  # of rows whose scene, metric or settings are a user's

# Rules of verdicts.
LEVEL = 0.05  # of the two-sided tests, and what an interval leaves out
TIE = 0.05  # share of a number up to which another one counts as equal
# % of skinning's excess. Shares well above it are compared by their logarithm, those below by their
# difference: arcsinh(x / SOFTENING) is one and the other, and defined for shares below zero.
SOFTENING = 1.0
LEAST_MOTIONS = 4  # below which two methods are not told apart
DRAWS, SEED = 10_000, 20220619  # of the bootstrap; the same draws for every comparison


def one_protocol(protocols: Iterable[str], where: object) -> str:
    """Return the protocol of rows that may stand in one table; empty where all are a user's own.

    Raises ResultsError, which says where they are, for rows of two protocols.

    >>> one_protocol(["1.0", "own"], "results.csv")
    '1.0'
    """
    numbers = sorted(set(protocols) - {OWN, ""})
    if len(numbers) > 1:
        raise ResultsError(
            f"{where}: rows of protocols {' and '.join(numbers)} do not stand in one table; run the "
            "older ones again, in a new folder or with --fresh"
        )
    return numbers[0] if numbers else ""


# Family and level of each member: a start perturbed by 1e-4 m, contact planes searched twice in each
# step, a tolerance a hundred times tighter. A simulation with another time step is none: it solves
# another problem.
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

    changes: by how much each member changes the number when it takes the reference's place. None for
    fewer than LEAST_MEMBERS.

    >>> spread([0.1, -0.1]), spread([0.1])
    (0.1, None)
    """
    values = [0.0, *changes]
    if len(values) <= LEAST_MEMBERS:
        return None
    mean = sum(values) / len(values)
    return math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))
