"""Protocol: its number and digests, the family of the reference, and the rules of verdicts of reports.

The number stands for all that a result depends on and that no method brings itself. Two numbers of the
same protocol can stand in one table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from benchmarks.provenance import digest
from benchmarks.results.row import ResultsError

NUMBER = "2.0"
# Part of the protocol -> digest of its definitions: tests/benchmarks/test_protocol.py compares them.
DIGESTS = {
    "scenes": "88c6128b67b3dd78",
    "materials": "37f8eb4aecad748b",
    "motions": "a3c9146af5c55bb4",
    "metrics": "8d678e8419e78ad3",
    "reference": "143d7369e2970032",
    "sampling": "9e5f35a896b154e9",
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


def one_protocol(protocols: Iterable[str], place: object) -> str:
    """Return the protocol of rows that may stand in one table; empty where all are a user's own.

    Raises ResultsError, which says where they are, for rows of two protocols.

    >>> one_protocol(["1.0", "own"], "results.csv")
    '1.0'
    """
    numbers = sorted(set(protocols) - {OWN, ""})
    if len(numbers) > 1:
        raise ResultsError(
            f"{place}: rows of protocols {' and '.join(numbers)} do not stand in one table; run the "
            "older ones again, in a new folder or with --fresh"
        )
    return numbers[0] if numbers else ""


# Time steps a frame -> the simulations with that step from two starts, the second moved by 1e-4 m. Both
# are equally valid answers to one problem, so what they differ by is the noise of a number. Simulations
# with other time steps solve other problems: what a number changes by between them is a trend, no noise.
STARTS = {1: ("simulation", "simulation-perturbed-1e-4")} | {
    steps: (f"simulation-dt/{steps}", f"simulation-dt/{steps}-perturbed-1e-4") for steps in (2, 4, 8)
}
REFERENCE = STARTS[1][0]
SECOND_STARTS = tuple(two for _, two in STARTS.values())
FAMILY = tuple(name for names in STARTS.values() for name in names if name != REFERENCE)


def noise(moved: Mapping[str, float]) -> float | None:
    """Return the standard deviation of a number over equally valid references; None without two starts.

    It is the root mean square, over the time steps, of the difference between two starts, divided by the
    root of 2. moved: by how much each member of FAMILY changes the number when it takes the reference's
    place.

    >>> noise({"simulation-perturbed-1e-4": 0.2}), noise({"simulation-dt/2": 0.3})
    (0.14142135623730953, None)
    """
    shifts = {REFERENCE: 0.0, **moved}
    gaps = [shifts[one] - shifts[two] for one, two in STARTS.values() if {one, two} <= shifts.keys()]
    return math.sqrt(sum(x * x for x in gaps) / (2 * len(gaps))) if gaps else None


def trend(moved: Mapping[str, float]) -> dict[str, float]:
    """Return the changes by members of FAMILY with smaller time steps alone."""
    return {name: change for name, change in moved.items() if name in FAMILY and name not in STARTS[1]}
