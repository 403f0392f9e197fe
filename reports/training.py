"""Training curves, from the histories that the models carry in the header of their files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reports.data import Run
from reports.plotting import PAGE_WIDTH, Picture, grid, legend_above, log_axis, new_figure, save
from reports.styles import leading, style

LARGEST_HEADER = 64_000_000  # bytes; a longer one is a broken file
PHYSICS = "physics loss [J per frame]"
# A loss of another kind has a panel of its own, known by the terms of it that were logged.
PANELS = {"vertices": "vertex loss [cm²]", "low": "vertex loss of two bands [cm]"}


class ModelHeaderError(ValueError):
    """A model file whose header cannot be read; the message names it."""


@dataclass(frozen=True)
class History:
    """How one model's loss fell: its method and, for every few steps, step, seconds, loss and terms."""

    method: str
    rows: list[dict[str, float]]

    @property
    def panel(self) -> str:
        return next((title for term, title in PANELS.items() if term in self.rows[0]), PHYSICS)

    def column(self, name: str) -> np.ndarray:
        return np.array([row.get(name, np.nan) for row in self.rows], dtype=float)


def read_history(path: Path) -> History | None:
    """The history in a model file, None where it has none. Raises ModelHeaderError for a broken file.

    A safetensors file starts with the length of its JSON header, eight bytes, little-endian.
    """
    try:
        with path.open("rb") as stream:
            length = int.from_bytes(stream.read(8), "little")
            if not 2 <= length <= LARGEST_HEADER:
                raise ValueError("its first bytes are no header length")
            header: dict[str, Any] = json.loads(stream.read(length))
        data = json.loads(header.get("__metadata__", {}).get("snug", "{}"))
    except (OSError, ValueError, AttributeError) as error:
        raise ModelHeaderError(f"{path}: no safetensors header ({error})") from None
    rows = data.get("history") or []
    method = path.stem.removesuffix(f"-seed{data.get('seed', 0)}")  # as the run names its files
    return History(method, rows) if len(rows) > 1 else None


def training_curves(folder: Path, run: Run, models: Path, problems: list[str]) -> list[Picture]:
    """Loss against training time: energies in one panel, distances of vertices in others."""
    histories = []
    for path in sorted(models.glob("[!.]*.safetensors")):  # no checkpoint of a training that was stopped
        try:
            history = read_history(path)
        except ModelHeaderError as error:
            problems.append(str(error).replace(f"{models.parent}/", ""))
            continue
        if history and history.method in run.methods:
            histories.append(history)
    shown = leading(run, {history.method for history in histories})
    histories = [history for history in histories if history.method in shown]
    titles = [title for title in (PHYSICS, *PANELS.values()) if any(h.panel == title for h in histories)]
    if not titles:
        return []
    figure = new_figure(PAGE_WIDTH * (1.0 if len(titles) > 1 else 0.6), 2.2)
    for axes, title in zip(np.atleast_1d(figure.subplots(1, len(titles))), titles):
        for history in histories:
            if history.panel == title:
                colour = style(run, history.method).colour
                axes.plot(history.column("seconds"), history.column("loss"), color=colour, linewidth=1.1)
        axes.set(xlabel="training time [s]", title=title)
        log_axis(axes, "y")
        grid(axes)
    legend_above(figure, [style(run, method) for method in shown], lines=True)
    caption = "Training loss against wall time; one curve per model and seed."
    return [save(figure, folder, "training", caption=caption, kind="curves")]
