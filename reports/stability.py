"""How far stiffness and time step go, as a map for each scene repeated over both; and refused inputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results import Row
from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, new_figure, power_text, save
from reports.summary import suite_rows
from reports.table import Column, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PREFIX = "map"
FEW, MANY = 2.0, 300.0  # iterations at the ends of the colour scale
PALE, DEEP = (0.90, 0.95, 0.99), (0.03, 0.27, 0.49)
TITLES = {"map_sheet": "Sheet, 81 vertices", "map_shirt": "T-shirt on a body, 300 vertices"}


@dataclass(frozen=True)
class Point:
    """One step of a map: factor on the stiffness, time step [s], and its row."""

    stiffness: float
    dt: float
    row: Row


def points(rows: Sequence[Row]) -> dict[str, list[Point]]:
    """The points of each map, by scene. The metric of a row is "map/<stiffness>/<dt>"."""
    found: dict[str, list[Point]] = {}
    for row in suite_rows(rows, "extremes"):
        words = row.metric.split("/")
        if words[0] == PREFIX and len(words) == 3:
            found.setdefault(row.scene, []).append(Point(float(words[1]), float(words[2]), row))
    return found


def stability_maps(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """All maps side by side: one cell per step, coloured by its iterations or by how it failed."""
    maps = points(rows)
    if not maps:
        return []
    heights = [len({point.stiffness for point in found}) for found in maps.values()]
    widths = [len({point.dt for point in found}) for found in maps.values()]
    figure = new_figure(PAGE_WIDTH if len(maps) > 1 else 0.55 * PAGE_WIDTH, 1.0 + 0.27 * max(heights))
    panels = figure.subplots(1, len(maps), squeeze=False, width_ratios=widths)[0]
    for axes, (scene, found) in zip(panels, maps.items()):
        _panel(axes, found)
        axes.set_title(TITLES.get(scene, scene))
    panels[0].set_ylabel("stiffness, as a multiple of cotton's")
    caption = (
        "Stiffness and time step: one step from a noisy start. Blue: converged, with its number of "
        "iterations, deeper for more. Other colours: not converged, by how it ended, said honestly; "
        "a cross: a false claim, a crash or a hang."
    )
    return [save(figure, folder, "stability_maps", caption=caption, section="extremes", kind="maps")]


def _panel(axes: Axes, found: Sequence[Point]) -> None:
    factors = sorted({point.stiffness for point in found})
    steps = sorted({point.dt for point in found})
    for point in found:
        _cell(axes, steps.index(point.dt), factors.index(point.stiffness), point.row)
    axes.set_xlim(-0.5, len(steps) - 0.5)
    axes.set_ylim(-0.5, len(factors) - 0.5)
    axes.set_xticks(range(len(steps)), [power_text(dt) for dt in steps])
    axes.set_yticks(range(len(factors)), [power_text(factor) for factor in factors])
    axes.set_xlabel("time step [s]")
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _cell(axes: Axes, column: int, line: int, row: Row) -> None:
    """A filled cell with the iterations, or with the word for how the step ended."""
    from matplotlib.patches import Rectangle

    converged = row.status == "ok"
    colour = shade(row.value) if converged else palette.STATUS_COLOURS[row.status]
    axes.add_patch(Rectangle((column - 0.48, line - 0.46), 0.96, 0.92, facecolor=colour, linewidth=0))
    iterations = f"{row.value:.0f}" if row.value is not None and math.isfinite(row.value) else ""
    word = iterations if converged else "✕" if row.status == "failed" else row.status
    dark = not converged or (row.value or 0.0) > 40.0
    text = axes.text(column, line, word, ha="center", va="center", fontsize=7.5)
    text.set_color("white" if dark else "#222222")
    if word == "✕":
        text.set_fontfamily("DejaVu Sans")  # the serif has no cross


def shade(iterations: float | None) -> tuple[float, float, float]:
    """From pale to deep blue, by the logarithm of the iterations."""
    place = math.log(max(iterations or FEW, FEW) / FEW) / math.log(MANY / FEW)
    place = min(place, 1.0)
    red, green, blue = (a + place * (b - a) for a, b in zip(PALE, DEEP))
    return red, green, blue


def outcome_columns(folder: Path, found: Sequence[Row]) -> Picture:
    """The cases of a single method in columns on one page, each worded and coloured by how it ended."""
    columns = 1 if len(found) <= 12 else 3
    lines = -(-len(found) // columns)
    figure = new_figure(PAGE_WIDTH if columns > 1 else 0.5 * PAGE_WIDTH, 0.2 + 0.21 * lines)
    axes = figure.subplots()
    for number, row in enumerate(found):
        _case(axes, number // lines, number % lines, row)
    axes.set_xlim(-0.01, columns - 0.02)
    axes.set_ylim(lines - 0.5, -0.5)
    axes.axis("off")
    caption = (
        f"How each extreme case ended for {palette.label(found[0].method)}. Blue: converged. The number is "
        "the largest gradient left, in vertex weights. The table says why the others did not."
    )
    return save(figure, folder, "extremes_1", caption=caption, section="extremes", kind="outcomes")


def _case(axes: Axes, column: int, line: int, row: Row) -> None:
    """A pale cell with a strip of the status's full colour at its left."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Rectangle

    colour = to_rgb(palette.STATUS_COLOURS[row.status])
    pale = tuple(1.0 - 0.28 * (1.0 - part) for part in colour)
    axes.add_patch(Rectangle((column, line - 0.43), 0.97, 0.86, facecolor=pale, linewidth=0))
    axes.add_patch(Rectangle((column, line - 0.43), 0.02, 0.86, facecolor=colour, linewidth=0))
    name = row.scene.replace("_", " ")
    axes.text(column + 0.035, line, name, ha="left", va="center", fontsize=7.2)
    known = row.value is not None and math.isfinite(row.value)
    words = [] if row.status == "ok" else [row.status]
    words += [power_text(row.value)] if known and row.value is not None else []
    axes.text(column + 0.955, line, "  ".join(words), ha="right", va="center", fontsize=7.2)


def refusals(rows: Sequence[Row]) -> Table | None:
    """Each bad input and the message that refused it."""
    lines = [
        (row.scene.partition("/")[2] or row.scene, row.status, row.reason)
        for row in suite_rows(rows, "extremes")
        if row.metric == "refusal"
    ]
    if not lines:
        return None
    columns = (
        Column("case", "Input"),
        Column("status", "Result"),
        Column("reason", "What it was told"),
    )
    return Table("refusals", columns, tuple(lines))
