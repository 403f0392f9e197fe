"""Does each solver's error fall along its own curve: more iterations or sweeps, a smaller tolerance?

It need not: a step's gap is judged from the method's own past, and cloth that folds otherwise has other
minima. So a rise is no failure, but whoever reads the curve has to know of it.
"""

from __future__ import annotations

from collections.abc import Mapping

METRIC = "gap/relative"
# The families of suite speed from coarse to fine; the last of "simulation" is the reference's finest.
CURVES = {
    "simulation": ("simulation-1e-2", "simulation-1e-4", "simulation", "simulation-1e-8"),
} | {
    family: tuple(f"{family}-{cut}" for cut in cuts)
    for family, cuts in (
        ("newton", (1, 2, 4, 8)),
        ("lbfgs", (5, 10, 20, 40)),
        ("gradient-descent", (10, 40)),
        ("vbd", (5, 20, 80)),
        ("xpbd", (10, 40, 160)),
        ("skinning+lbfgs", (1, 2, 4, 8)),
        ("skinning+newton", (1, 2, 4, 8)),
        ("snug+lbfgs", (1, 2, 4, 8)),
        ("snug+newton", (1, 2, 4, 8)),
    )
}
ROUND_OFF = 1e-6  # a gap below it counts as none: who is called lower there is chance


def rises(found: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """For each method whose gap is above that of a coarser one of its family: a remark that says so.

    found: the metrics of each method of one scene (and seed), by name; those without a gap are left out.
    """
    remarks = {}
    for family in CURVES.values():
        lowest = ("", float("inf"))
        for method in family:
            gap = found.get(method, {}).get(METRIC)
            if gap is None:
                continue
            if gap > max(lowest[1], ROUND_OFF):
                remarks[method] = f"not monotone: a gap of {gap:.2g}, but {lowest[0]} has {lowest[1]:.2g}"
            if gap < lowest[1]:
                lowest = method, gap
    return remarks
