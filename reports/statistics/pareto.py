"""Methods as points in the plane of run time and error: which are beaten by none, who first reaches what."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd

from reports.run.rows import Run
from reports.statistics.means import means

TIME, REPEATS = "cost/frame", "cost/spread"
WHOLE = "cost/whole"  # TIME is a method's own work; this is all from pose to world vertices
# Of the method's own step first: no chaos blurs them. Then those of the roll-out against the simulation's.
ERRORS = (
    "gap/energy", "step/curvature", "step/distance", "curvature/error", "distance/rms", "curvature/histogram",
)  # fmt: skip
PLANES = {"gap/energy": "gap/refrozen"}  # what the reference leaves where its planes are searched at its end
SMALLER_STEPS = "simulation-dt"  # a family of another problem: its steps have another potential


MOST_SLACK = 0.2  # share of a run time within which another one may count as no slower


@dataclass(frozen=True)
class Point:
    """A method's run time [ms per frame] and error.

    time_spread: how far runs lie apart [ms]: largest less smallest repeat where it was repeated, else two
    standard deviations over seeds. error_spread: one standard deviation over seeds or, where that is more,
    how far another simulation as right as the reference moves it. Both 0 where unknown.
    fewer: words on seeds that are missing, empty where none is.
    """

    method: str
    time: float
    error: float
    time_spread: float = 0.0
    error_spread: float = 0.0
    fewer: str = ""


def points_of(run: Run, frame: pd.DataFrame, scenes: Sequence[str], metric: str, x: str = "") -> list[Point]:
    """Every method that has both numbers in all the scenes, as means over them and the seeds that did all.

    x: another metric than the run time.
    """
    rows = frame[frame["scene"].isin(list(scenes))]
    x = x or run_time(rows)
    measured = rows[rows["usable"] & rows["metric"].isin([metric, x])].groupby(["method", "seed"]).size()
    whole = measured.index[measured == len(scenes) * len({metric, x})]
    in_all = rows.set_index(["method", "seed"]).index.isin(whole)
    rows = rows.assign(usable=rows["usable"] & in_all)
    rows = rows[rows["metric"].isin([metric, x, TIME, REPEATS]) | ~rows["usable"]]
    wide = means(rows, "method", "metric")
    found = []
    for method in run.ordered(rows["method"]):
        time, error, own, repeats = (wide.get((method, name)) for name in (x, metric, TIME, REPEATS))
        if time is None or error is None:
            continue
        spread = 2.0 * (time.spread or 0.0)
        if repeats is not None and own is not None and x in (TIME, WHOLE):
            spread = own.value * repeats.value / 100.0
        found.append(
            Point(method, time.value, error.value, spread, error.spread_or_uncertainty or 0.0, error.fewer)
        )
    return found


def run_time(rows: pd.DataFrame) -> str:
    """The metric of run time that these rows share: from pose to vertices where every timed cell has that."""
    usable = rows[rows["usable"]].set_index(["scene", "method", "seed"])
    own, whole = (usable.index[usable["metric"] == name] for name in (TIME, WHOLE))
    return WHOLE if len(whole) and own.isin(whole).all() else TIME


def front(points: Iterable[Point]) -> list[Point]:
    """Those to which no other is at once at least as fast and as accurate, from fast to accurate."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.time, p.error, p.method)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def fastest(points: Iterable[Point], error: float) -> Point | None:
    """The fastest with at most that error, or None."""
    reached = [point for point in points if point.error <= error]
    return min(reached, key=lambda p: (p.time, p.error, p.method)) if reached else None


def of_one_problem(run: Run, points: Iterable[Point]) -> list[Point]:
    """Those that solve what the reference solves."""
    return [p for p in points if run.methods[p.method].family != SMALLER_STEPS]


def solvers(run: Run, points: Iterable[Point]) -> list[Point]:
    """Solvers alone, truncated or to a tolerance, with nothing learned, of the reference's own problem."""
    kept = set(run.with_role("reference", "solver", "reference-variant"))
    return [p for p in of_one_problem(run, points) if p.method in kept]


def truncated(run: Run, points: Iterable[Point]) -> list[Point]:
    """Of the solvers alone those that differ from others of their family by one number."""
    return [p for p in solvers(run, points) if run.methods[p.method].level is not None]


def indistinct(run: Run, rows: pd.DataFrame, metric: str) -> float:
    """The error [unit of the metric] below which a method is as near to the reference as another right one.

    The largest of simulations from moved starts and with planes searched twice; of the gap what the
    reference leaves on planes searched at its end. 0 where none is known.
    """
    who, what = ([run.reference], PLANES[metric]) if metric in PLANES else (run.twins, metric)
    kept = rows[rows["usable"] & (rows["metric"] == what) & rows["method"].isin(who)]["value"]
    return float(kept.max()) if len(kept) else 0.0


def beaten_by(points: Sequence[Point], own: Point) -> Point | None:
    """The most accurate of those that are no slower and no less accurate, None where there is none."""
    faster = [p for p in points if p is not own and overtaken(own, [p])]
    return min(faster, key=lambda p: p.error) if faster else None


def overtaken(point: Point, others: Sequence[Point]) -> bool:
    """Whether one of the others is no less accurate, and no slower by more than the point's own repeats.

    A rival whose run times scatter widely is no faster for that; nor is one that takes much longer.
    """
    latest = point.time + min(point.time_spread, MOST_SLACK * point.time)
    return any(p.error <= point.error and p.time <= latest for p in others)
