"""A change between two runs, and from which size on a difference is one."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.metric import Metric
from reports.statistics.effects import DIFFERENCE, RATIO, Effect
from reports.statistics.means_and_spreads import Mean
from reports.tables.number_texts import number, with_spread

GONE, WORSE, BETTER, OTHER = "gone", "worse", "better", "changed"  # verdicts, the first two fail
FAILING = (GONE, WORSE)
ENERGY_TOLERANCE = 0.02  # share of an energy
TOLERANCE = 0.05  # share of any other answer
TIME_TOLERANCE = 0.15  # share of a time or memory that was repeated
ONCE = 2.0  # factor of a time that was taken once: below it another load of the machine may be the cause
FLOOR = 1e-4  # share of the median method's value; a smaller difference is none, whatever it is a share of
SPREADS = 3.0  # of the reference's ensemble, beyond which an answer that nothing repeats has changed


@dataclass(frozen=True)
class Change:
    """One line of a comparison.

    Attributes:
        verdict: GONE, WORSE, BETTER or OTHER.
        place: garment or scene.
        method: name of the method.
        metric: name of the metric.
        size: the change in words.
    """

    verdict: str
    place: str
    method: str
    metric: str
    size: str


def tolerance_of(metric: Metric) -> float:
    """Return the share of a number up to which another one counts as equal.

    >>> tolerance_of(Metric(name="energy/strain", unit="J", title="Strain", definition=""))
    0.02
    """
    if metric.of == "machine":
        return TIME_TOLERANCE
    of_energy = metric.name.startswith(("energy/", "relative_excess/"))
    return ENERGY_TOLERANCE if of_energy else TOLERANCE


def side(metric: Metric, difference: float) -> str:
    """Return whether a difference of that sign is worse or better, or just another number."""
    if metric.lower_is_better is None:
        return OTHER
    return WORSE if bool(difference > 0.0) is metric.lower_is_better else BETTER


def size_of_means(metric: Metric, mean: Mean, new: Mean, far: Effect, p: float | None) -> str:
    """Return a change as "0.21 ± 0.010 -> 0.26 ± 0.010 J, × 1.24 (1.20 to 1.28), p 0.0030"."""
    before, after = (with_spread(m.value, m.spread_or_uncertainty) for m in (mean, new))
    text = f"{before} -> {after}{_unit(metric)}, {'×' if far.scale == RATIO else 'by'} {number(far.shown)}"
    if far.interval:
        text += f" ({' to '.join(number(end) for end in far.interval)})"
    return text + ("" if p is None else f", p {number(p, 2)}")


def size_of_values(metric: Metric, before: float, after: float) -> str:
    """Return a change as "0.21 -> 0.26 J, × 1.24"."""
    text = f"{number(before)} -> {number(after)}{_unit(metric)}"
    return f"{text}, × {number(after / before)}" if before > 0.0 and after > 0.0 else text


def _unit(metric: Metric) -> str:
    return "" if metric.unit in ("", "1") else f" {metric.unit}"


def within_tolerance(metric: Metric, mean: Mean, new: Mean, far: Effect, scale: float) -> bool:
    """Return whether a change of means is too small to be one.

    Args:
        metric: of the means.
        mean: the earlier one.
        new: the later one.
        far: the effect of the later against the earlier one.
        scale: the median method's value there; unit of a difference whose unit is unknown.
    """
    if abs(new.value - mean.value) <= FLOOR * scale:
        return True
    share = tolerance_of(metric)
    if far.scale == DIFFERENCE:
        return abs(far.value) <= share * (far.unit or scale)
    return max(far.shown, 1.0 / far.shown) <= 1.0 + share if far.shown > 0.0 else False
