"""Training histories, as models carry them in the header of their files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

LAST, FROM = 10, 0.8  # losses in a mean at the end of a training; the share of its steps it is compared with
# By the unit of the loss, of the energies and of simulated vertices: their squares, or two bands of them.
PANELS = {
    "J": "physics loss [J per frame]",
    "cm²": "vertex loss [cm²]",
    "cm": "vertex loss of two bands [cm]",
}


@dataclass(frozen=True)
class History:
    """Loss of one model over its training.

    unit: of the loss. rows: for every few steps, step, seconds, loss and terms, at some the value on held-out
    motions. frames: number that it learned from. best_step: that of the least value on held-out motions, nan
    where there are none.
    """

    method: str
    unit: str
    rows: list[dict[str, float]]
    garment: str = ""
    seed: int = 0
    frames: int | None = None
    best_step: float = np.nan

    @property
    def panel(self) -> str:
        """Title of the panel of this kind of loss."""
        return PANELS.get(self.unit, f"loss [{self.unit}]")

    def column(self, name: str) -> np.ndarray:
        """Return one number of every logged step (N,), nan where it was not logged."""
        return np.array([row.get(name, np.nan) for row in self.rows], dtype=float)

    @property
    def last_loss(self) -> float:
        """Mean of the last LAST losses."""
        return float(self.column("loss")[-LAST:].mean())

    @property
    def decrease(self) -> float:
        """Fall of the loss in the last fifth of the steps [%]; nan where few were logged."""
        steps, losses = self.column("step"), self.column("loss")
        before = losses[steps <= FROM * steps[-1]][-LAST:]
        enough = len(before) == LAST and (steps > FROM * steps[-1]).sum() >= LAST
        return float(100.0 * (1.0 - self.last_loss / before.mean())) if enough else np.nan


def read_history(path: Path, method: str) -> History | None:
    """Return the history in a model file, None without one. Raises ValueError for a broken file."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, "numpy") as stored:
            header: Any = json.loads((stored.metadata() or {}).get("snug", "{}"))
    except (OSError, ValueError, RecursionError, SafetensorError) as error:
        raise ValueError(f"{path}: no safetensors header ({error})") from None
    if not isinstance(header, dict):
        raise ValueError(f"{path}: its entry 'snug' is a {type(header).__name__}, no table")
    rows, unit = header.get("history") or [], header.get("unit", "")
    summary = header.get("summary") or {}
    best = (summary.get("validation") or {}).get("best_step", np.nan)
    frames = summary.get("training_frames")
    return History(method, unit, rows, frames=frames, best_step=best) if len(rows) > 1 else None
