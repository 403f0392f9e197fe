"""Stored roll-outs of a run, read when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

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
