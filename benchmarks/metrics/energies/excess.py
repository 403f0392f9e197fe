"""Metrics excess/*: energy above that of the vertices optimised directly, the lowest found.

The lowest is what optimising all vertices of the scene directly has found (the method whose role is "bound"):
what a dresser could reach whose output were not bound to its input. It is the lowest in the sum of all terms,
so in the sum without gravity a method may lie below it.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from benchmarks.metric import Metric
from benchmarks.metrics.energies.energy import energies

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

_metric = partial(Metric, unit="J", table="energies", lower_is_better=True)

METRICS = (
    _metric(name="excess/total", title="Excess",
            definition="sum of all terms less that of the vertices optimised directly, mean over frames"),
    _metric(name="excess/without_gravity", title="Excess without gravity",
            definition="the same difference without gravity, which a method can lower by letting the cloth "
            "sag"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the mean excess [J per frame], with and without gravity; empty without the bound."""
    lowest = roll_out.group.find(role="bound")
    if lowest is None or lowest is roll_out:
        return {}
    ours, theirs = energies(roll_out), energies(lowest)
    frames = roll_out.judged_beside(lowest.positions)
    above = {name: float((ours[name][frames] - theirs[name][frames]).mean()) for name in ours}
    return {
        "excess/total": above["total"],
        "excess/without_gravity": above["total"] - above.get("gravity", 0.0),
    }
