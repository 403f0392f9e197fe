"""From how many frames on a training pays: the total cost of N frames, by method."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.results.row import BEFORE_FRAMES
from reports.figures.plotting import PAGE_WIDTH, Picture, grid, legend_above, log_axis, new_figure, save
from reports.figures.styles import leading, style
from reports.run.rows import Run
from reports.statistics.means import mean_of, value_of
from reports.statistics.pareto import TIME, fastest, points_of, run_time, solvers
from reports.tables.numbers import number
from reports.tables.table import Cell, Column, Table, table

NETWORK = "snug"  # the method whose accuracy a solver has to reach to be its rival
ACCURACIES = (("gap/energy", "energy gap"), ("curvature/error", "curvature error"))
MOST_FRAMES = 1e7


@dataclass(frozen=True)
class Cost:
    """What a method costs [s]: before the first frame (data, setup, training) and for each frame."""

    method: str
    before: float
    frame: float

    def total(self, frames: float) -> float:
        return self.before + frames * self.frame


def cost_of(frame: pd.DataFrame, method: str, scenes: Sequence[str]) -> Cost | None:
    """The cost of a method on the scenes given, or None where it was not timed there, or not in full."""
    time = value_of(frame, method, run_time(frame[frame["scene"].isin(list(scenes))]), scenes)
    data, setup, train = (value_of(frame, method, name, scenes) for name in BEFORE_FRAMES)
    if time is None or (train is not None and data is None):
        return None  # what its simulations took is not known any more
    return Cost(method, (data or 0.0) + (setup or 0.0) + (train or 0.0), time / 1e3)


def crossing(dear: Cost, cheap: Cost) -> float | None:
    """Frames from which `dear`, that costs more at the start, is the cheaper one; None if never."""
    if dear.frame >= cheap.frame:
        return None
    return max(0.0, (dear.before - cheap.before) / (cheap.frame - dear.frame))


def frames_text(frames: float) -> str:
    """A number of frames to two digits: more would not last until the next run."""
    return number(float(f"{frames:.1e}"), 6, trim=True)


def rivals(run: Run, frame: pd.DataFrame, scenes: Sequence[str]) -> dict[str, str]:
    """Solvers that SNUG competes with: method -> why, the converged one and the fastest as accurate as it."""
    found = {run.reference: "converged"} if mean_of(frame, run.reference, TIME, scenes) else {}
    for metric, words in ACCURACIES:
        points = points_of(run, frame, scenes, metric)
        own = next((p for p in points if p.method == NETWORK), None)
        best = fastest(solvers(run, points), own.error) if own else None
        if best is not None and best.method != run.reference:
            found[best.method] = f"{found[best.method]} and {words}" if best.method in found else words
    return found


def compared_scenes(run: Run, frame: pd.DataFrame) -> dict[str, list[str]]:
    """Garment -> the scenes in which SNUG was timed beside a truncated solver.

    Those of suite speed where there are any: whole motions have no energy gap.
    """
    timed = frame[frame["usable"] & (frame["metric"] == TIME) & (frame["garment"] != "")]
    levels = {name for name, method in run.methods.items() if method.level is not None}
    both = set(timed[timed["method"] == NETWORK]["scene"]) & set(timed[timed["method"].isin(levels)]["scene"])
    rows = timed[timed["scene"].isin(both)]
    of_speed = rows[rows["suite"] == "speed"]
    return run.garments(of_speed if len(of_speed) else rows)


def compared_costs(
    run: Run, frame: pd.DataFrame, scenes: Sequence[str], against: Iterable[str]
) -> tuple[list[Cost], list[Cost]]:
    """Costs of the networks that were trained, and of the solvers given, that were timed on the scenes."""
    rows = frame[frame["scene"].isin(list(scenes))]
    training = rows[rows["usable"] & (rows["metric"] == "cost/train") & (rows["value"] > 0.0)]["method"]
    alone = [m for m in training if run.methods[m].role in ("network", "ablation", "baseline")]
    found = ([cost_of(rows, m, scenes) for m in methods] for methods in (run.ordered(alone), against))
    networks, others = ([cost for cost in costs if cost is not None] for costs in found)
    return networks, others


def crossings(run: Run) -> list[Table]:
    """From how many frames on each trained network is cheaper than the solvers it competes with."""
    frame = run.cells("speed", "garments")
    lines: list[tuple[Cell, ...]] = []
    for garment, scenes in compared_scenes(run, frame).items():
        why = rivals(run, frame, scenes)
        for network, rival in itertools.product(*compared_costs(run, frame, scenes, why)):
            frames = crossing(network, rival)
            total = None if frames is None else network.total(frames)
            rounded = None if frames is None else float(f"{frames:.1e}")
            times = rival.frame / network.frame if network.frame else None
            names = (garment, network.method, rival.method, why[rival.method])
            lines.append((*names, rounded, total, network.before, times))
    columns = (
        Column("garment", "Garment", text=True),
        Column("method", "Network", text=True, method=True),
        Column("solver", "Overtakes", text=True, method=True),
        Column("as_good", "As good by", text=True),
        Column("crossing", "From frames on", digits=2, trim=True),
        Column("total_time", "Total time by then", "s"),
        Column("before", "Network's before its first frame", "s"),
        Column("frame_ratio", "Its run time over the network's", digits=2),
    )
    caption = (
        "From how many frames on training pays, against the converged simulation and the fastest solvers "
    )
    caption += "as good as SNUG; a dash: never."
    return table("crossings", columns, lines, caption, grouped_by=("garment",))


def break_even(folder: Path, run: Run) -> list[Picture]:
    """One figure: total time of N frames for each trained network and for the solvers it competes with."""
    frame = run.cells("speed", "garments")
    scenes = next(iter(compared_scenes(run, frame).values()), [])
    trained, others = compared_costs(run, frame, scenes, rivals(run, frame, scenes))
    shown = leading(run, (cost.method for cost in trained))
    trained = [cost for cost in trained if cost.method in shown]
    costs = [*others, *trained]
    if not trained or len(costs) < 2:
        return []
    figure = new_figure(PAGE_WIDTH / 2, 2.7)
    axes = figure.subplots()
    frames = np.logspace(0, math.log10(MOST_FRAMES), 200)
    for cost in costs:
        look = style(run, cost.method)
        axes.plot(frames, [cost.total(n) for n in frames], color=look.colour, linestyle=look.line)
    for network, rival in itertools.product(trained, others):
        met = crossing(network, rival)
        if met is not None and 1.0 <= met <= MOST_FRAMES:
            colour = style(run, network.method).colour
            axes.plot(met, network.total(met), "o", color=colour, markersize=4.5)
    axes.set(xlabel="frames", ylabel="data, training and frames [s]")
    log_axis(axes, "x")
    log_axis(axes, "y")
    grid(axes)
    legend_above(figure, [style(run, method) for method in run.ordered(c.method for c in costs)], lines=True)
    caption = (
        f"Total time against the number of frames ({', '.join(scenes)}). Dots: where a training has paid."
    )
    return [save(figure, folder, "break_even", caption=caption, kind="break_even")]
