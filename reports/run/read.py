"""What a run has left in its folder: its rows and settings, its trajectories."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder

if TYPE_CHECKING:
    from reference_sim.trajectory.trajectory import Trajectory
    from reports.run.rows import Run


def read_run(folder: RunFolder) -> Run:
    """The rows of the folder and their declarations. Raises ResultsError."""
    if not folder.path.is_dir():
        raise ResultsError(f"{folder.path}: no such folder")
    config, rows = folder.read_config(), folder.read_rows()
    if not rows:
        raise ResultsError(f"{folder.rows_path}: holds no rows; nothing to report")
    from reports.run.rows import run_data
    from reports.statistics.by_frame import read_frames

    run = run_data(config, rows, folder.changed(config))
    return replace(run, frames=read_frames(folder.frame_energies_path))


def read_trajectory(folder: RunFolder, path: Path, problems: list[str]) -> Trajectory | None:
    """A trajectory of the run with its curves, None where there is none; what cannot be read is a problem."""
    from reference_sim.files.array_file import read_arrays
    from reference_sim.trajectory.trajectory import Trajectory, TrajectoryError

    try:
        if not path.is_file():
            return None
        trajectory = Trajectory.load(path)
        if (curves := path.with_suffix(".npz")).is_file():
            trajectory = replace(trajectory, frame_fields=trajectory.frame_fields | read_arrays(curves))
        if trajectory.frames:
            return trajectory
        problems.append(f"{path.relative_to(folder.path)}: holds no whole frame")
    except (TrajectoryError, ValueError, OSError) as error:
        problems.append(str(error).replace(f"{folder.path}/", ""))
    return None
