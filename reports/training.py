"""Training curves, from the histories that the models carry in the header of their files."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, grid, legend_above, log_axis, new_figure, save

LARGEST_HEADER = 64_000_000  # bytes; a longer one is a broken file
PHYSICS = "physics loss [J per frame]"


class ModelHeaderError(ValueError):
    """A model file whose header cannot be read; the message names it."""


@dataclass(frozen=True)
class History:
    """How one model's loss fell: its method and, for every few steps, step, seconds, loss and terms."""

    method: str
    rows: list[dict[str, float]]

    @property
    def panel(self) -> str:
        """What its loss is, by the terms of it that were logged: each kind has a panel of its own."""
        terms = {"vertices": "vertex loss [cm²]", "low": "vertex loss of two bands [cm]"}
        return next((title for term, title in terms.items() if term in self.rows[0]), PHYSICS)

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
    return History(re.sub(r"-seed\d+$", "", path.stem), rows) if len(rows) > 1 else None


def training_curves(folder: Path, models: Path, problems: list[str]) -> list[Picture]:
    """Loss against training time: energies in one panel, distances of vertices in others."""
    histories = []
    for path in sorted(models.glob("[!.]*.safetensors")):  # no checkpoint of a training that was stopped
        try:
            history = read_history(path)
        except ModelHeaderError as error:
            problems.append(str(error).replace(f"{models.parent}/", ""))
            continue
        if history:
            histories.append(history)
    shown = palette.leading({history.method for history in histories})
    histories = [history for history in histories if history.method in shown]
    titles = sorted({history.panel for history in histories}, key=lambda title: (title != PHYSICS, title))
    panels = [(title, [h for h in histories if h.panel == title]) for title in titles]
    return [_draw(folder, panels)] if panels else []


def _draw(folder: Path, panels: Sequence[tuple[str, list[History]]]) -> Picture:
    figure = new_figure(PAGE_WIDTH if len(panels) > 1 else PAGE_WIDTH * 0.6, 2.2)
    for axes, (title, histories) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels):
        for history in histories:
            look = palette.style(history.method)
            axes.plot(history.column("seconds"), history.column("loss"), color=look.colour, linewidth=1.1)
        axes.set(xlabel="training time [s]", title=title)
        log_axis(axes, "y")
        grid(axes)
    methods = palette.ordered(history.method for _, histories in panels for history in histories)
    legend_above(figure, methods, lines=True)
    caption = "Training loss against wall time; one curve per model and seed."
    return save(figure, folder, "training", caption=caption, section="garments", kind="training")
