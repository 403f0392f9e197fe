"""One frame at a time beside many bodies at once: what networks give up when they are asked for one frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.results import Row
from reports import palette
from reports.ablations import set_apart
from reports.canvas import PAGE_WIDTH, Picture, grid, log_axis, new_figure, save
from reports.numbers import number
from reports.summary import Mean, Measurements, suite_rows, wardrobe
from reports.table import Cell, Column, Table

SINGLE, BATCH = "cost/frame", "cost/batch"


def pairs(rows: Sequence[Row]) -> list[tuple[str, str, Mean, Mean]]:
    """Garment, method, ms of a frame alone and in a batch, of networks that were measured both ways.

    Ablations are left out where the full recipe stands for them.
    """
    own = [Measurements(suite_rows(rows, suite)) for suite in ("garments", "speed")]
    measured = own[0] if BATCH in own[0].metrics else own[1]
    found = []
    for garment, scenes in wardrobe(measured).items():
        apart = set_apart(measured, scenes, BATCH)
        for method in measured.methods:
            both = [s for s in scenes if measured.seeds(s, method, BATCH)]
            single, batch = (measured.mean(method, metric, both) for metric in (SINGLE, BATCH))
            if single and batch and method not in apart:
                found.append((garment, method, single, batch))
    return found


def throughput(rows: Sequence[Row]) -> Table | None:
    """Latency and throughput of each network."""
    lines: list[tuple[Cell, ...]] = [
        (garment, method, one, many, 1e3 / one.value, 1e3 / many.value, one.value / many.value)
        for garment, method, one, many in pairs(rows)
    ]
    if not lines:
        return None
    columns = (
        Column("garment", "Garment"),
        Column("method", "Method"),
        Column("run_time", "Frame", "ms"),
        Column("batch", "In batch", "ms"),
        Column("single_rate", "Alone", "frames/s"),
        Column("batch_rate", "In batch", "frames/s"),
        Column("gain", "Times"),
    )
    return Table("throughput", columns, tuple(lines))


def throughput_bars(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """Frames per second of each network of the first garment, alone (hollow) and in a batch (full)."""
    found = pairs(rows)
    found = [pair for pair in found if pair[0] == found[0][0]]
    if not found:
        return []
    figure = new_figure(PAGE_WIDTH, 0.75 + 0.24 * len(found))
    axes = figure.subplots()
    for place, (_, method, one, many) in enumerate(found):
        look = palette.style(method)
        rates = [1e3 / one.value, 1e3 / many.value]
        axes.plot(rates, [place, place], color=look.colour, linewidth=1.6, zorder=2)
        for rate, fill in zip(rates, ("white", look.colour)):
            axes.plot(rate, place, marker=look.marker, color=look.colour, markerfacecolor=fill, zorder=3)
        for rate, shift, side in ((min(rates), -7, "right"), (max(rates), 7, "left")):
            axes.annotate(
                number(float(f"{rate:.2e}"), 6, trim=True), (rate, place), (shift, 0), fontsize=8,
                textcoords="offset points", ha=side, va="center",
            )  # fmt: skip
    every = [1e3 / mean.value for _, _, *means in found for mean in means]
    axes.set_xlim(min(every) / 1.7, max(every) * 1.7)
    log_axis(axes, "x")
    axes.set_yticks(range(len(found)), [palette.label(method) for _, method, _, _ in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.set_xlabel("frames per second")
    grid(axes, "x")
    caption = f"{found[0][0]}: frames per second of each network with its skinning, one frame at a time "
    caption += "(hollow) and many bodies at once (full), both on one core."
    return [save(figure, folder, "throughput", caption=caption, section="garments", kind="throughput")]
