"""Break-even of a training: number of frames from which its total cost is below that of a solver."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd

from benchmarks.results.row import BEFORE_FRAMES
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import mean_of, value_of
from reports.statistics.pareto import TIME, fastest, points_of, run_time, solvers

NETWORK = "snug"  # the method whose accuracy a solver has to reach to be its rival
ACCURACIES = (("gap/energy", "energy gap"), ("curvature/error", "curvature error"))


@dataclass(frozen=True)
class Cost:
    """Cost of a method [s]: before the first frame (data, setup, training) and of each frame."""

    method: str
    before: float
    frame: float

    def total(self, frames: float) -> float:
        """Return the cost of that many frames [s]."""
        return self.before + frames * self.frame


def cost_of(frame: pd.DataFrame, method: str, scenes: Sequence[str]) -> Cost | None:
    """Return the cost of a method on the scenes, None where it was not timed there, or not in full."""
    time = value_of(frame, method, run_time(frame[frame["scene"].isin(list(scenes))]), scenes)
    data, setup, train = (value_of(frame, method, name, scenes) for name in BEFORE_FRAMES)
    if time is None or (train is not None and data is None):
        return None  # the time of its simulations is not known any more
    return Cost(method, (data or 0.0) + (setup or 0.0) + (train or 0.0), time / 1e3)


def crossing(dear: Cost, cheap: Cost) -> float | None:
    """Return from how many frames on `dear`, dearer at the start, is the cheaper one; None: never."""
    if dear.frame >= cheap.frame:
        return None
    return max(0.0, (dear.before - cheap.before) / (cheap.frame - dear.frame))


def rivals(run: Run, frame: pd.DataFrame, scenes: Sequence[str]) -> dict[str, str]:
    """Return the solvers that SNUG competes with, method -> why: converged, or the fastest as accurate."""
    reasons = {run.reference: "converged"} if mean_of(frame, run.reference, TIME, scenes) else {}
    for metric, measure in ACCURACIES:
        points = points_of(run, frame, scenes, metric)
        network = next((p for p in points if p.method == NETWORK), None)
        best = fastest(solvers(run, points), network.error) if network else None
        if best is not None and best.method != run.reference:
            before = reasons.get(best.method)
            reasons[best.method] = f"{before} and {measure}" if before else measure
    return reasons


def compared_scenes(run: Run, frame: pd.DataFrame) -> dict[str, list[str]]:
    """Return garment -> scenes in which SNUG was timed beside a truncated solver.

    Those of suite speed where there are any: whole motions have no energy gap.
    """
    timed = frame[frame["usable"] & (frame["metric"] == TIME) & (frame["garment"] != "")]
    levels = {name for name, method in run.methods.items() if method.level is not None}
    both = set(timed[timed["method"] == NETWORK]["scene"]) & set(timed[timed["method"].isin(levels)]["scene"])
    rows = timed[timed["scene"].isin(both)]
    of_speed = rows[rows["suite"] == "speed"]
    return run.garments(of_speed if len(of_speed) else rows)


def reference_scenes(run: Run) -> list[str]:
    """Return the scenes of the first garment in which references are compared with each other.

    Those of suite speed in which SNUG was timed beside a truncated solver; without any, all whole motions.
    """
    clips = compared_scenes(run, run.cells("speed"))
    return next(iter((clips or run.garments(run.garment_rows)).values()), [])


def compared_costs(
    run: Run, frame: pd.DataFrame, scenes: Sequence[str], against: Iterable[str]
) -> tuple[list[Cost], list[Cost]]:
    """Return the costs of the trained networks and of the solvers given, where timed on the scenes."""
    rows = frame[frame["scene"].isin(list(scenes))]
    training = rows[rows["usable"] & (rows["metric"] == "cost/train") & (rows["value"] > 0.0)]["method"]
    alone = [m for m in training if run.methods[m].role in ("network", "ablation", "baseline")]
    costs = ([cost_of(rows, m, scenes) for m in methods] for methods in (run.ordered(alone), against))
    networks, others = ([cost for cost in known if cost is not None] for known in costs)
    return networks, others
