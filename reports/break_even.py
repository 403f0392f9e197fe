"""From how many frames on a training pays: the total cost of N frames, by method."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.results import Row
from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, grid, legend_above, log_axis, new_figure, save
from reports.fronts import TIME, fastest, points_of, solvers
from reports.numbers import duration, number
from reports.summary import Measurements, dressed_scenes, speed_measurements, wardrobe, worn_scenes
from reports.table import Cell, Column, Table

ACCURACIES = (("gap/relative", "energy gap"), ("curvature/error", "curvature error"))
MOST_FRAMES = 1e7
FEW = 3  # networks whose crossings a caption has room for; of more it names SNUG's, and a table all


@dataclass(frozen=True)
class Cost:
    """What a method costs [s]: before the first frame (data, making ready, training) and for each frame."""

    method: str
    before: float
    frame: float

    def total(self, frames: float) -> float:
        return self.before + frames * self.frame


def cost_of(measured: Measurements, method: str, scenes: Sequence[str]) -> Cost | None:
    """The cost of a method on the scenes given, or None where it was not timed there, or not in full."""
    frame = measured.value(method, TIME, scenes)
    if frame is None:
        return None
    costs = {what: measured.value(method, f"cost/{what}", scenes) for what in ("data", "setup", "train")}
    if costs["train"] is not None and costs["data"] is None:
        return None  # what its simulations took is not known any more
    return Cost(method, sum(cost or 0.0 for cost in costs.values()), frame / 1e3)


def crossing(dear: Cost, cheap: Cost) -> float | None:
    """Frames from which `dear`, that costs more at the start, is the cheaper one; None if never."""
    if dear.frame >= cheap.frame:
        return None
    return max(0.0, (dear.before - cheap.before) / (cheap.frame - dear.frame))


def frames_text(frames: float) -> str:
    """A number of frames to two digits: more would not last until the next run."""
    return number(float(f"{frames:.1e}"), 6, trim=True)


def rivals(measured: Measurements, scenes: Sequence[str], network: str = "snug") -> dict[str, str]:
    """Solvers a network competes with: method -> why, the converged one and the fastest as accurate as it."""
    found = {palette.REFERENCE: "converged"} if palette.REFERENCE in measured.methods else {}
    for metric, words in ACCURACIES:
        points = points_of(measured, scenes, metric)
        own = next((p for p in points if p.method == network), None)
        best = fastest(solvers(points), own.error) if own else None
        if best is not None and best.method != palette.REFERENCE:
            found[best.method] = f"{found[best.method]} and {words}" if best.method in found else words
    return found


def compared_scenes(measured: Measurements, network: str = "snug") -> list[str]:
    """The scenes of any garment on which the network was timed beside a cut solver."""
    return [
        scene
        for scene in worn_scenes(measured)
        if measured.seeds(scene, network, TIME)
        and any(palette.cut_of(m) and measured.seeds(scene, m, TIME) for m in measured.methods)
    ]


def compared_costs(
    measured: Measurements, scenes: Sequence[str], against: Iterable[str]
) -> tuple[list[Cost], list[Cost]]:
    """Costs of the networks that were trained, and of the solvers given, that were timed on the scenes."""
    trained = [
        m
        for m in palette.leading(measured.methods)
        if not palette.cut_of(m) and (measured.value(m, "cost/train", scenes) or 0.0) > 0.0
    ]
    found = ([cost_of(measured, m, scenes) for m in methods] for methods in (trained, against))
    networks, solvers_ = ([cost for cost in costs if cost is not None] for costs in found)
    return networks, solvers_


def crossings(rows: Sequence[Row]) -> Table | None:
    """From how many frames on each trained network is cheaper than the solvers it competes with."""
    measured = speed_measurements(rows)
    lines: list[tuple[Cell, ...]] = []
    for garment, scenes in wardrobe(measured.only(compared_scenes(measured))).items():
        networks, against = compared_costs(measured, scenes, rivals(measured, scenes))
        for network in networks:
            for rival in against:
                frames = crossing(network, rival)
                total = None if frames is None else network.total(frames)
                rounded = None if frames is None else float(f"{frames:.1e}")
                lines.append((garment, network.method, palette.label(rival.method), rounded, total))
    if not lines:
        return None
    columns = (
        Column("garment", "Garment"),
        Column("method", "Network"),
        Column("solver", "Overtakes"),
        Column("crossing", "From frames on"),
        Column("total_time", "Total time by then", "s"),
    )
    return Table("crossings", columns, tuple(lines))


def break_even(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """One figure: total time of N frames for each trained network and for the solvers it competes with."""
    measured = speed_measurements(rows)
    scenes = dressed_scenes(measured.only(compared_scenes(measured)))
    if not scenes:
        return []
    against = rivals(measured, scenes)
    trained, rival_costs = compared_costs(measured, scenes, against)
    costs = [*rival_costs, *trained]
    if not trained or len(costs) < 2:
        return []
    figure = new_figure(PAGE_WIDTH * 0.8, 3.1)
    axes = figure.subplots()
    frames = np.logspace(0, math.log10(MOST_FRAMES), 200)
    for cost in costs:
        look = palette.style(cost.method)
        axes.plot(frames, [cost.total(n) for n in frames], color=look.colour, linestyle=look.line)
    told = _mark_crossings(axes, trained, rival_costs)
    axes.set(xlabel="frames", ylabel="data, training and frames [s]")
    axes.set_xscale("log")
    log_axis(axes, "y")
    grid(axes)
    legend_above(figure, palette.ordered(c.method for c in costs), lines=True)
    caption = f"Total time against the number of frames ({', '.join(scenes)}). {told} "
    caption += " ".join(
        f"{palette.label(m)} is the fastest solver with at most SNUG's {why}."
        for m, why in against.items()
        if m != palette.REFERENCE
    )
    return [save(figure, folder, "break_even", caption=caption, section="speed", kind="break_even")]


def _mark_crossings(axes, trained: Sequence[Cost], against: Sequence[Cost]) -> str:
    """A dot at each crossing, and the sentence that names them."""
    parts, crossed = [], False
    for network in trained:
        for rival in against:
            frames = crossing(network, rival)
            if frames is not None and 1.0 <= frames <= MOST_FRAMES:
                total, crossed = network.total(frames), True
                axes.plot(frames, total, "o", color=palette.style(network.method).colour, markersize=4.5)
                if len(trained) > FEW and network.method != "snug":
                    continue
                names = f"{palette.label(network.method)} overtakes {palette.label(rival.method)}"
                parts.append(f"{names} at {frames_text(frames)} frames ({duration(total)})")
    if parts:
        return "; ".join(parts) + "."
    return "SNUG's training does not pay." if crossed else "No training pays within ten million frames."
