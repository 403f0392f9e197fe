"""Methods as points in the plane of run time and error, and the Pareto front among them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import pandas as pd

from reports.finished_run import Run
from reports.statistics.means_and_spreads import error_of_twin, mean_of, means

TIME, REPEATS = "cost/frame", "cost/spread"
WHOLE = "cost/whole"  # from pose to world vertices; TIME is a method's own work
# First those of a method's own step, which no chaos blurs; then of its roll-out.
ERRORS = (
    "gap/energy", "step/curvature", "step/distance", "curvature/histogram", "distance/rms", "curvature/error",
)  # fmt: skip
SMALLER_STEPS = "simulation-dt"  # a family of another problem: its steps have another potential
# Of the step's own potential, which another step size changes.
OWN_STEP = ("gap/energy", "step/curvature", "step/distance")


@dataclass(frozen=True)
class Point:
    """Run time [ms per frame] and error of a method.

    time_spread [ms]: the larger of two standard deviations over seeds and the range of repeats.
    error_spread: the larger of one standard deviation and the reference's noise. Both 0 if unknown.
    """

    method: str
    time: float
    error: float
    time_spread: float = 0.0
    error_spread: float = 0.0


def points_of(run: Run, rows: pd.DataFrame, metric: str) -> list[Point]:
    """Return a point for each method that has both numbers in all the scenes and seeds.

    rows: of the scenes averaged over; a seed counts only where it has both numbers in every scene. metric:
    name of the error.
    """
    x = run_time(rows)
    names = x, metric, TIME, REPEATS
    measured = rows[rows["usable"] & rows["metric"].isin([metric, x])].groupby(["method", "seed"]).size()
    full_pairs = measured.index[measured == 2 * rows["scene"].nunique()]
    in_all = rows.set_index(["method", "seed"]).index.isin(full_pairs)
    rows = rows.assign(usable=rows["usable"] & in_all)
    rows = rows[rows["metric"].isin(names) | ~rows["usable"]]
    wide = means(rows, "method", "metric")
    points = []
    for method in run.order(rows["method"]):
        time, error, inference, repeats = (wide.get((method, name)) for name in names)
        if time is None or error is None:
            continue
        spread = 2.0 * (time.spread or 0.0)
        if repeats is not None and inference is not None:
            spread = max(spread, inference.value * repeats.value / 100.0)
        points.append(Point(method, time.value, error.value, spread, error.spread_or_uncertainty or 0.0))
    return points


def run_time(rows: pd.DataFrame) -> str:
    """Return the metric of run time of these rows: end-to-end time where every timed cell has it."""
    usable = rows[rows["usable"]].set_index(["scene", "method", "seed"])
    inference, totals = (usable.index[usable["metric"] == name] for name in (TIME, WHOLE))
    return WHOLE if len(totals) and inference.isin(totals).all() else TIME


def time_label(metric: str) -> str:
    """Return the label of an axis of run time."""
    return f"run time, {'pose to vertices' if metric == WHOLE else 'own work'} [ms per frame]"


def front(points: Iterable[Point]) -> list[Point]:
    """Return the Pareto front: points that no other beats in both, from fast to accurate."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.time, p.error, p.method)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def solvers(run: Run, points: Iterable[Point]) -> list[Point]:
    """Return the points of solvers without anything learned, of the reference's discrete problem."""
    names = set(run.with_role("reference", "solver", "reference-variant"))
    return [p for p in points if p.method in names and run.methods[p.method].family != SMALLER_STEPS]


def noise_floor(run: Run, rows: pd.DataFrame, metric: str) -> float:
    """Return the error [unit of the metric] below which a method cannot be told from the reference.

    It is the error of the reference's twin from another start, the mean of scenes; of the energy gap what
    the reference leaves on planes searched at its end. 0 where none is known.
    """
    if metric == "gap/energy":
        gaps = rows[rows["usable"] & (rows["metric"] == "gap/refrozen")]
        gaps = gaps[gaps["method"] == run.reference]
        of_scene = gaps.groupby("scene", observed=True)["value"].mean().abs()
    else:
        of_scene = error_of_twin(rows, metric)
    return float(of_scene.mean()) if len(of_scene) else 0.0


def select_plot_cells(run: Run) -> tuple[pd.DataFrame, list[str]]:
    """Return the rows of plots of error against run time, and their scenes in order.

    Scenes of the first garment come first, among them those on which most methods were timed.
    """
    cells = run.cells("speed", "garments")
    timed = cells[cells["usable"] & (cells["metric"] == TIME)]
    ablations = run.find_ablations(timed)
    frame = cells[~cells["method"].isin(ablations)]
    counts = timed[~timed["method"].isin(ablations)].groupby("scene")["method"].nunique()
    first = next(iter(run.garments(frame).values()), [])
    scenes = [scene for scene in dict.fromkeys(frame["scene"]) if scene in counts]
    return frame, sorted(scenes, key=lambda scene: (scene not in first, -int(counts[scene])))


def error_points(run: Run, rows: pd.DataFrame, metric: str) -> list[Point]:
    """Return the points of one panel, without the reference, whose error is zero."""
    points = points_of(run, rows, metric)
    # Smaller steps have errors of the garment, but none of the reference's own step.
    left_out = (SMALLER_STEPS,) if metric in OWN_STEP else ()
    others = [p for p in points if p.method != run.reference and p.time > 0.0]
    return [p for p in others if run.methods[p.method].family not in left_out]


NETWORK = "snug"  # the method whose accuracy a solver has to reach to be its rival
ACCURACIES = ("gap/energy", "curvature/histogram")


def rivals(run: Run, timed: pd.DataFrame) -> list[str]:
    """Return the solvers that SNUG competes with: the reference, and the fastest ones as accurate."""
    names = [run.reference] if mean_of(timed, run.reference, TIME) else []
    for metric in ACCURACIES:
        points = points_of(run, timed, metric)
        if network := next((p for p in points if p.method == NETWORK), None):
            best = front(solvers(run, points))
            names += [p.method for p in best if p.error <= network.error][:1]
    return list(dict.fromkeys(names))


def select_timed(run: Run, others: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Return rows of scenes of the first garment in which SNUG and a method with a level were timed.

    Their names come second. Of suite speed where it has any: whole motions have no energy gap.
    others: rows where there are none.
    """
    cells = run.cells("speed", "garments")
    timed = cells[cells["usable"] & (cells["metric"] == TIME) & (cells["garment"] != "")]
    levels = {name for name, method in run.methods.items() if method.level is not None}
    of_network, of_solvers = timed["method"] == NETWORK, timed["method"].isin(levels)
    rows = timed[timed["scene"].isin({*timed[of_network]["scene"]} & {*timed[of_solvers]["scene"]})]
    of_speed = rows[rows["suite"] == "speed"]
    scenes = next(iter(run.garments(of_speed if len(of_speed) else rows).values()), [])
    return cells[cells["scene"].isin(scenes)] if scenes else others, scenes
