"""Training curves, from the histories that the models carry in the header of their files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.results.run_folder import RunFolder, model_path
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
from reports.figures.styles import leading, style
from reports.run.rows import Run
from reports.statistics.means import Mean
from reports.tables.table import Cell, Column, Table, table

CURVES, ENDS = "training_curves", "trainings"
LAST, FROM = 10, 0.8  # losses in a mean at the end of a training; the share of its steps it is compared with
# By the unit of the loss, of the energies and of simulated vertices: their squares, or two bands of them.
PANELS = {
    "J": "physics loss [J per frame]",
    "cm²": "vertex loss [cm²]",
    "cm": "vertex loss of two bands [cm]",
}


class ModelHeaderError(ValueError):
    """A model file whose header cannot be read; the message names it."""


@dataclass(frozen=True)
class History:
    """How one model's loss fell: its method, the unit of its loss and, for every few steps, step, seconds,
    loss and terms, and at some the value on held-out motions. `kind`: of its network; `frames`: that it
    learned from; `best_step`: that of the least value on held-out motions, nan where there are none.
    """

    method: str
    unit: str
    rows: list[dict[str, float]]
    garment: str = ""
    seed: int = 0
    frames: int | None = None
    kind: str = ""
    best_step: float = np.nan

    @property
    def panel(self) -> str:
        """The title of the panel of its kind of loss."""
        return PANELS.get(self.unit, f"loss [{self.unit}]")

    def column(self, name: str) -> np.ndarray:
        return np.array([row.get(name, np.nan) for row in self.rows], dtype=float)

    @property
    def last_loss(self) -> float:
        """Mean of the last losses."""
        return float(self.column("loss")[-LAST:].mean())

    @property
    def decrease(self) -> float:
        """By how much they lie below those before four fifths of the steps [%]; nan where few were logged."""
        steps, losses = self.column("step"), self.column("loss")
        before = losses[steps <= FROM * steps[-1]][-LAST:]
        enough = len(before) == LAST and (steps > FROM * steps[-1]).sum() >= LAST
        return float(100.0 * (1.0 - self.last_loss / before.mean())) if enough else np.nan


def read_history(path: Path, method: str) -> History | None:
    """The history in a model file, None where it has none. Raises ModelHeaderError for a broken file."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, "numpy") as stored:
            data: dict[str, Any] = json.loads((stored.metadata() or {}).get("snug", "{}"))
    except (OSError, ValueError, SafetensorError) as error:
        raise ModelHeaderError(f"{path}: no safetensors header ({error})") from None
    rows = data.get("history") or []
    summary = data.get("summary") or {}
    kind, unit = data.get("kind", ""), data.get("unit", "")
    best = (summary.get("validation") or {}).get("best_step", np.nan)
    frames = summary.get("training_frames")
    return History(method, unit, rows, frames=frames, kind=kind, best_step=best) if len(rows) > 1 else None


def read_histories(folder: RunFolder, run: Run, problems: list[str]) -> list[History]:
    """Those of every network in the run's folder, garment by garment."""
    found: list[History] = []
    worn = run.frame[run.frame["garment"] != ""][["garment", "method", "seed"]].drop_duplicates()
    for garment, rows in worn.groupby("garment", sort=False):
        for _, method, seed in rows.itertuples(index=False):
            path = model_path(folder.models_of(str(garment)), method, seed)
            if not path.is_file():
                continue
            try:
                history = read_history(path, method)
            except ModelHeaderError as error:
                problems.append(str(error).replace(f"{folder.path}/", ""))
            else:
                found += [replace(history, garment=str(garment), seed=int(seed))] if history else []
    return found


def trainings(run: Run, histories: Sequence[History]) -> list[Table]:
    """How long each network trained, and how its loss ended; means over seeds."""
    groups: dict[tuple[str, str], list[History]] = {}
    for history in histories:
        groups.setdefault((history.garment, history.method), []).append(history)
    place = {method: k for k, method in enumerate(run.ordered({method for _, method in groups}))}
    lines: list[tuple[Cell, ...]] = []
    for (garment, method), own in sorted(groups.items(), key=lambda item: place[item[0][1]]):
        ends = [
            (h.frames, h.rows[-1]["step"], h.best_step, h.rows[-1]["seconds"], h.last_loss, h.decrease)
            for h in own
        ]
        lines.append((garment, method, len(own), *map(_over_seeds, zip(*ends)), own[0].unit))
    order = list(dict.fromkeys(history.garment for history in histories))
    lines.sort(key=lambda line: order.index(str(line[0])))
    columns = (
        Column("garment", "Garment", text=True), Column("method", "Method", text=True, method=True),
        Column("seeds", "Seeds"), Column("frames", "Frames", digits=6, trim=True),
        Column("steps", "Steps", digits=6, trim=True),
        Column("best", "Best on held-out", digits=6, trim=True), Column("seconds", "Training", "s"),
        Column("loss", "Loss at its end", mixed=True), Column("decrease", "Fell in last fifth", "%"),
        Column("unit", "Unit of loss", text=True),
    )  # fmt: skip
    filled = [k for k in range(len(columns)) if any(line[k] is not None for line in lines)]
    lines = [tuple(line[k] for k in filled) for line in lines]
    caption = (
        f"How trainings ended. Losses are means of {LAST} logged ones. The fall is from the {LAST} before "
        "four fifths of the steps. Where the rate falls to zero, a loss levels off by itself."
    )
    return table(ENDS, [columns[k] for k in filled], lines, caption, grouped_by=("garment",))


def _over_seeds(values: Sequence[float | None]) -> Mean | float | None:
    """Their mean and spread; a number that no seed changes as it is."""
    known = {("", seed): x for seed, x in enumerate(values) if x is not None and np.isfinite(x)}
    found = np.array(list(known.values()), dtype=float)
    if len(found) == len(values) and len(set(known.values())) == 1:
        return float(found[0])
    spread = float(found.std(ddof=1)) if len(found) > 1 else None
    return Mean(float(found.mean()), spread, 1, len(found), len(values), cells=known) if known else None


def curves_table(histories: Sequence[History]) -> list[Table]:
    """Every point of the curves: they are too many for a page."""
    words = [Column(name, name, text=True) for name in ("garment", "method")]
    numbers = [Column(name, name, unit) for name, unit in (("seed", ""), ("step", ""), ("seconds", "s"))]
    columns = (*words, *numbers, Column("loss", "loss"), Column("validation", "validation"))
    lines: list[tuple[Cell, ...]] = [
        (h.garment, h.method, h.seed, int(row["step"]), row["seconds"], row["loss"], row.get("validation"))
        for h in histories
        for row in h.rows
    ]
    return table(CURVES, columns, lines)


def training_curves(folder: Path, run: Run, histories: Sequence[History]) -> list[Picture]:
    """A figure for each garment: loss against training time, a panel for each kind of loss."""
    pictures: list[Picture] = []
    for garment in dict.fromkeys(history.garment for history in histories):
        name = f"training_{file_name(garment)}" if pictures else "training"
        own = [history for history in histories if history.garment == garment]
        pictures += _curves(folder, run, name, f"{garment}: training loss", own)
    return pictures


def _curves(folder: Path, run: Run, name: str, what: str, histories: Sequence[History]) -> list[Picture]:
    shown = leading(run, {history.method for history in histories})
    histories = [history for history in histories if history.method in shown]
    panels = dict.fromkeys((*PANELS.values(), *(h.panel for h in histories)))
    titles = [title for title in panels if any(h.panel == title for h in histories)]
    if not titles:
        return []
    figure = new_figure(PAGE_WIDTH * (1.0 if len(titles) > 1 else 0.6), 2.2)
    for axes, title in zip(np.atleast_1d(figure.subplots(1, len(titles))), titles):
        for history in histories:
            if history.panel == title:
                look = style(run, history.method)
                axes.plot(history.column("seconds"), history.column("loss"), color=look.colour,
                    linestyle=look.line, linewidth=1.1)  # fmt: skip
        axes.set(xlabel="training time [s]", title=title)
        log_axis(axes, "y")
        grid(axes)
    legend_above(figure, [style(run, method) for method in shown], lines=True)
    caption = f"{what} against wall time; one curve per model and seed. Numbers: tables/{CURVES}.csv."
    return [save(figure, folder, name, caption=caption, kind="curves")]
