"""What each network makes of how many frames: the equal-data block of a run.

Its methods are trained variants that a number of mixed frames for each given one tells apart, their level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.results.row import BEFORE_FRAMES
from reports.figures.plotting import (
    PAGE_WIDTH,
    Picture,
    file_name,
    grid,
    legend_above,
    log_axis,
    new_figure,
    save,
)
from reports.figures.styles import KNOWN, Style, family_style, style
from reports.figures.training import History
from reports.run.rows import Run
from reports.statistics.means import mean_of, value_of
from reports.tables.table import Cell, Column, Table, metric_column, table

FRAMES, STEPS = "cost/train_frames", "cost/train_steps"
JUDGED = ("energy/total", "energy/strain", "penetration/vertices", "curvature/error")
DRAWN = ("energy/total", "curvature/error")
WIDE = 2.0  # from the lower to the upper end of an axis that is logarithmic


def members(run: Run) -> list[str]:
    """The methods of the block, in order."""
    trained = set(run.worn[run.worn["usable"] & (run.worn["metric"] == FRAMES)]["method"])
    return [
        name for name in run.ordered(trained)
        if run.methods[name].role == "ablation" and run.methods[name].level is not None
    ]  # fmt: skip


def equal_data(run: Run) -> list[Table]:
    """Frames, steps and seconds of each method of the block, and how good it is; the reference first."""
    metrics = [run.metrics[name] for name in (FRAMES, STEPS, *BEFORE_FRAMES, *JUDGED) if name in run.metrics]
    lines: list[tuple[Cell, ...]] = []
    block = members(run)
    for garment in run.garments(run.worn) if block else ():
        rows = run.worn[run.worn["garment"] == garment]
        for method in filter(None, (run.reference, *block)):
            found = {metric.name: mean_of(rows, method, metric.name) for metric in metrics}
            spent = [found[name] for name in BEFORE_FRAMES if found.get(name)]
            total = sum(mean.value for mean in spent if mean) if spent else None
            mixed = run.methods[method].level
            head = (garment, method, None if mixed is None else int(mixed), total)
            lines.append((*head, *found.values()))
    columns = (
        Column("garment", "Garment", text=True),
        Column("method", "Method", text=True, method=True),
        Column("mixed", "Mixed for each given frame"),
        Column("seconds", "Data and training", "s"),
        *(
            replace(metric_column(metric), digits=6, trim=True)
            if metric.name in (FRAMES, STEPS)
            else metric_column(metric)
            for metric in metrics
        ),
    )
    caption = "Networks that learn from the same motions: what they had, what it cost, what came of it."
    return table("equal_data", columns, lines, caption, grouped_by=("garment",))


def error_against_frames(folder: Path, run: Run) -> list[Picture]:
    """Energy and curvature error against training frames, a line for each network at equal steps."""
    block = members(run)
    shown = [name for name in block if run.methods[name].base not in block]  # others are variants of these
    metrics = [name for name in DRAWN if name in run.metrics]
    garment = next(iter(run.garments(run.worn)), "")
    rows = run.worn[run.worn["garment"] == garment]
    families = list(dict.fromkeys(run.methods[name].family for name in shown))
    if len(shown) == len(families) or not metrics:  # no line has two ends
        return []
    figure = new_figure(PAGE_WIDTH, 2.6)
    looks = {family: family_style(run, run.methods[_first(run, shown, family)]) for family in families}
    for axes, metric in zip(np.atleast_1d(figure.subplots(1, len(metrics))), metrics):
        level, declared = value_of(rows, run.reference, metric), run.metrics[metric]
        above = declared.arbitrary_zero and level is not None
        zero, lowest = (level or 0.0) if above else 0.0, np.inf
        for family, look in looks.items():
            means = [
                (value_of(rows, name, FRAMES), mean_of(rows, name, metric))
                for name in shown
                if run.methods[name].family == family
            ]
            points = [(x, mean.value - zero, mean.spread or 0.0) for x, mean in means if x and mean]
            if points:
                x, y, spread = zip(*points)
                lowest = min(lowest, *y)
                axes.errorbar(x, y, spread, color=look.colour, marker=look.marker, linestyle=look.line,
                    markersize=4, capsize=2)  # fmt: skip
        if level is not None and not above:
            axes.axhline(level, color=style(run, run.reference).colour, linewidth=0.9, linestyle="--")
        words = f"{declared.title} above the simulation's" if above else declared.title
        axes.set(xlabel="training frames", ylabel=f"{words} [{declared.unit}]")
        log_axis(axes, "x")
        if metric == DRAWN[0] and lowest > 0.0:
            log_axis(axes, "y")
        grid(axes)
    legend_above(figure, list(looks.values()), lines=False)
    caption = f"{garment}: error against training frames, given ones and mixed ones beside them, at equal "
    caption += "steps; bars: spread over seeds; dashed: the simulation."
    return [save(figure, folder, "equal_data", caption=caption, kind="equal data")]


def held_out_curves(folder: Path, run: Run, histories: Sequence[History]) -> list[Picture]:
    """A figure for each garment: the value on held-out motions over the steps of each training that these
    stop, a panel for each kind of value.
    """
    watched = [h for h in histories if h.method in run.methods and np.isfinite(h.column("validation")).any()]
    pictures: list[Picture] = []
    for garment in dict.fromkeys(history.garment for history in watched):
        name = f"held_out_{file_name(garment)}" if pictures else "held_out"
        own = [history for history in watched if history.garment == garment]
        pictures.append(_held_out(folder, run, name, garment, own))
    return pictures


def _held_out(folder: Path, run: Run, name: str, garment: str, watched: Sequence[History]) -> Picture:
    panels = list(dict.fromkeys(history.panel for history in watched))
    looks: dict[str, Style] = {}
    for history in watched:  # in the colour of the network, whatever it learned from
        own, known = style(run, history.method), KNOWN.get(history.kind)
        looks[history.method] = replace(own, colour=known.colour) if known else own
    figure = new_figure(PAGE_WIDTH, 2.4)
    for axes, panel in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels):
        seen: list[float] = []
        for history in (history for history in watched if history.panel == panel):
            value, look = history.column("validation"), looks[history.method]
            there = np.isfinite(value)
            seen += value[there].tolist()
            axes.plot(history.column("step")[there], value[there], color=look.colour, linestyle=look.line)
        axes.set(xlabel="steps", title=panel)
        if max(seen) > WIDE * min(seen) > 0.0:
            log_axis(axes, "y")
        grid(axes)
    legend_above(figure, [looks[method] for method in run.ordered(looks)], lines=True)
    caption = f"{garment}: trainings that end when held-out motions get no better: the value on these. "
    caption += "A line per seed."
    return save(figure, folder, name, caption=caption, kind="equal data")


def _first(run: Run, methods: Sequence[str], family: str) -> str:
    return next(name for name in methods if run.methods[name].family == family)
