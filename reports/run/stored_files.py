"""Stored roll-outs and training histories of a run, read when they are asked for."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.results.run_folder import RunFolder
from reference_sim.files.array_file import ArrayFileError, read_array, read_arrays
from reference_sim.trajectory import Trajectory, TrajectoryError

STEP = "step/vertices"  # of the curves of a roll-out: the one-step error of each vertex (T,V) [mm]


@dataclass(frozen=True)
class RollOuts:
    """Stored roll-outs of a run's folder, none without one.

    One that cannot be read adds a sentence to `problems`.
    """

    folder: RunFolder | None = None
    problems: list[str] = field(default_factory=list)

    def cloth(self, scene: str, method: str, seed: int) -> Trajectory | None:
        """Return a method's roll-out of the scene, None where there is none to be read."""
        return self._read(self.folder.trajectory_path(scene, method, seed)) if self.folder else None

    def body(self, scene: str) -> Trajectory | None:
        """Return the moving body of the scene, None where there is none to be read."""
        return self._read(self.folder.trajectory_path(scene, "body")) if self.folder else None

    def rest_areas(self, scene: str) -> np.ndarray | None:
        """Return areas (F,) [m^2] at rest of the faces of the scene's garment, None where unknown."""
        try:
            return read_array(self.folder.rest_areas_path(scene)) if self.folder else None
        except ArrayFileError:
            return None

    def _read(self, path: Path) -> Trajectory | None:
        """Return the trajectory in a file with the curves that lie beside it, None without one."""
        try:
            if not path.is_file():
                return None
            trajectory = Trajectory.load(path)
            if (curves := path.with_suffix(".npz")).is_file():
                trajectory = replace(trajectory, frame_fields=trajectory.frame_fields | read_arrays(curves))
            if trajectory.frames:
                return trajectory
            problem = f"{path}: holds no whole frame"
        except (TrajectoryError, ValueError, OSError) as error:
            problem = str(error)
        problem = without_folder(self.folder, problem)
        if problem not in self.problems:  # the page reads again what was drawn
            self.problems.append(problem)
        return None


def without_folder(folder: RunFolder | None, problem: object) -> str:
    """Return the sentence with paths as seen from the folder of the run."""
    return str(problem).replace(f"{folder.path}/", "") if folder else str(problem)


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
    motions.
    """

    method: str
    unit: str
    rows: list[dict[str, float]]
    garment: str = ""

    @property
    def panel(self) -> str:
        """Title of the panel of this kind of loss."""
        return PANELS.get(self.unit, f"loss [{self.unit}]")

    def column(self, name: str) -> np.ndarray:
        """Return one number of every logged step (N,), nan where it was not logged."""
        return np.array([row.get(name, np.nan) for row in self.rows], dtype=float)


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
    rows = header.get("history") or []
    return History(method, header.get("unit", ""), rows) if len(rows) > 1 else None
