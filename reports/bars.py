"""What was asked of this benchmark before it ran: each bar, the number that came out, whether it is met."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from benchmarks.results import Row
from reports.ablations import ROLL_OUTS, TRAINING
from reports.scatter import paired, scatter, spreads_of
from reports.summary import TSHIRT, Mean, Measurements, suite_rows, wardrobe
from reports.table import Cell, Column, Table

CAPTION = "What was asked beforehand of SNUG at about 1000 vertices and 120 s of training, and what came out."
ASKED = "quick"  # the preset of those sizes
SWINGING = ("tunic/twist_stop",)  # unseen, of a garment that swings


@dataclass(frozen=True)
class Bar:
    """A number that should be at most, or at least, `bound`; `value` finds it in (measured, roll-outs).

    each: whether every seed has to meet it, and not their mean.
    """

    words: str
    unit: str
    bound: float
    value: Callable[[Measurements, Measurements], Mean | None]
    at_least: bool = False
    each: bool = False


def bars() -> tuple[Bar, ...]:
    """Every bar, in the order of the table."""
    return (
        Bar("Total above the free lower bound", "%", 8.0, _share("energy/total", "snug", "free-bound")),
        Bar("Strain below skinning's, so many times", "1", 5.0, _times("energy/strain", "skinning", "snug"),
            at_least=True),
        Bar("Strain beside PBNS", "%", -20.0, _share("energy/strain", "snug", "pbns")),
        Bar("Vertices below the skin", "%", 5.0, _of("penetration/vertices", "snug")),
        Bar("Roll-outs on training motions, above windows", "%", 3.0, _roll_out_above_windows),
        Bar("Windows above 2 J once training has settled", "1", 0.0, _trained("train/high_windows"),
            each=True),
        Bar("One training step of 16 windows, beside another training", "ms", 20.0, _trained("train/step")),
        Bar("All training steps", "s", 120.0, _of("cost/train", "snug")),
        Bar("One frame", "ms", 0.5, _of("cost/frame", "snug")),
        Bar("Tunic in twist_stop: A of the dynamic recipe", "1", 0.5, _swing("dynamics/amplitude"),
            at_least=True),
        Bar("Its correlation", "1", 0.65, _swing("dynamics/correlation"), at_least=True),
        Bar("Its strain, off the simulation's", "%", 25.0, _swing_strain),
    )  # fmt: skip


def table(rows: Sequence[Row]) -> Table | None:
    """The bars that this run can judge; None where it has no SNUG network, or other sizes than were asked."""
    if any(row.preset not in ("", ASKED) for row in rows):
        return None
    measured, long = (Measurements(suite_rows(rows, suite)) for suite in ("garments", ROLL_OUTS))
    lines: list[tuple[Cell, ...]] = []
    for bar in bars():
        found = bar.value(measured, long)
        if found is not None:
            bound = f"{'at least' if bar.at_least else 'at most'} {bar.bound:g}".replace("-", "−")
            lines.append((bar.words, found, bound, bar.unit, met(bar, found) + found.fewer))
    if not lines:
        return None
    columns = (
        Column("finding", "Bar"),
        Column("value", "Here"),
        Column("bound", "Asked"),
        Column("unit", "Unit"),
        Column("status", "Result"),
    )
    return Table("bars", columns, tuple(lines))


def met(bar: Bar, found: Mean) -> str:
    """In words. Where a mean is asked for, one nearer to its bound than seeds scatter is said to be."""
    if bar.each:
        if found.lost:
            return "missed"
        worst = (min if bar.at_least else max)(found.by_seed.values())
        found = replace(found, value=worst, spread=None)
    exact = Mean(bar.bound, None, found.scenes, seeds=1, complete=True, seeded=False)
    if found.spread and abs(found.value - bar.bound) <= scatter(found, exact):
        return "within the scatter of seeds"
    within = found.value >= bar.bound if bar.at_least else found.value <= bar.bound
    return "met" if within else "missed"


def ratio(one: Mean | None, other: Mean | None) -> Mean | None:
    """one / other. Its spread over the root of its seeds is the standard error of the ratio.

    Of one network's two numbers the ratio is taken seed by seed.
    """
    if one is None or other is None or not one.value or not other.value:
        return None
    if pairs := paired(one, other):
        each = [first / second for first, second in pairs]
        return replace(
            one, value=statistics.fmean(each), spread=statistics.stdev(each), by_seed={},
            complete=one.complete and other.complete, stalled=one.stalled or other.stalled,
        )  # fmt: skip
    value = one.value / other.value
    spread, seeds = None, one.seeds
    if spreads := spreads_of(one, other):
        seeds = min(mean.seeds for mean in (one, other) if mean.spread is not None)
        errors = (s / (m.value * math.sqrt(m.seeds)) for s, m in zip(spreads, (one, other)))
        spread = abs(value) * math.hypot(*errors) * math.sqrt(seeds)
    return replace(
        one,
        value=value,
        spread=spread,
        seeds=seeds,
        complete=one.complete and other.complete,
        stalled=one.stalled or other.stalled,
        by_seed={},
        seeded=one.seeded or other.seeded,
    )


def _percent(mean: Mean | None) -> Mean | None:
    """A ratio as percent above 1."""
    if mean is None:
        return None
    spread = None if mean.spread is None else 100.0 * mean.spread
    return replace(mean, value=100.0 * (mean.value - 1.0), spread=spread)


def _shirt(measured: Measurements) -> Sequence[str]:
    return wardrobe(measured).get(TSHIRT, ())


def _of(metric: str, method: str) -> Callable[[Measurements, Measurements], Mean | None]:
    return lambda measured, _: measured.mean(method, metric, _shirt(measured))


def _times(metric: str, one: str, other: str) -> Callable[[Measurements, Measurements], Mean | None]:
    def found(measured: Measurements, _: Measurements) -> Mean | None:
        return ratio(*measured.pair(one, other, metric, _shirt(measured)))

    return found


def _share(metric: str, one: str, other: str) -> Callable[[Measurements, Measurements], Mean | None]:
    times = _times(metric, one, other)
    return lambda measured, long: _percent(times(measured, long))


def _trained(metric: str) -> Callable[[Measurements, Measurements], Mean | None]:
    return lambda _, long: long.mean("snug", metric, TRAINING)


def _roll_out_above_windows(_: Measurements, long: Measurements) -> Mean | None:
    ends = (long.mean("snug", f"train/{what}", TRAINING) for what in ("roll_out", "window"))
    return _percent(ratio(*ends))


def _swing(metric: str) -> Callable[[Measurements, Measurements], Mean | None]:
    return lambda measured, _: measured.mean("snug-dynamic", metric, SWINGING)


def _swing_strain(measured: Measurements, _: Measurements) -> Mean | None:
    above = _percent(ratio(*measured.pair("snug-dynamic", "simulation", "energy/strain", SWINGING)))
    return None if above is None else replace(above, value=abs(above.value))
