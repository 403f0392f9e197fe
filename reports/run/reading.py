"""Reading of a run's folder: the one module of the reports that opens what a run has left."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from benchmarks.results import run_folder
from benchmarks.results.protocol import one_protocol
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder, model_path
from reference_sim.trajectory import Trajectory
from reports.run.finished_run import Run, make_run
from reports.run.stored_files import History, RollOuts, read_history, without_folder


def read_run_with_trainings(folder: RunFolder) -> Run:
    """Read a run and how its networks were trained. Raises ResultsError for a folder that holds no run."""
    run = read_run(folder)
    return replace(run, histories=_read_histories(folder, run))


def read_run(folder: RunFolder) -> Run:
    """Read rows and declarations of a run; its roll-outs are read when they are asked for.

    Raises:
        ResultsError: when run.json or results.csv is absent, broken or of an earlier version, or rows are of
            two protocols, which no table may mix.

    >>> run = read_run(RunFolder("reports/runs/first"))  # doctest: +SKIP
    """
    if not folder.path.is_dir():
        raise ResultsError(f"{folder.path}: no such folder")
    config, rows = folder.read_config(), folder.read_rows()
    if not rows:
        raise ResultsError(f"{folder.rows_path}: holds no rows; nothing to report")
    run = make_run(config, rows, folder.changed(config))
    return replace(
        run,
        protocol=one_protocol(run.frame["protocol"], folder.rows_path),
        frame_energies=_read_frame_energies(folder.frame_energies_path),
        roll_outs=RollOuts(folder, run.problems),
    )


def _read_frame_energies(path: Path) -> pd.DataFrame:
    """Return the lines of run_folder.csv, none without the file. Raises ResultsError."""
    if not path.is_file():
        return pd.DataFrame()
    columns, lines = run_folder.read(path)
    return pd.DataFrame(lines, columns=columns)


def _read_histories(folder: RunFolder, run: Run) -> list[History]:
    """Read the training of every network in the run's folder, garment by garment."""
    histories: list[History] = []
    networks = run.frame[run.frame["garment"] != ""][["garment", "method", "seed"]].drop_duplicates()
    for garment, rows in networks.groupby("garment", sort=False):
        for _, method, seed in rows.itertuples(index=False):
            path = model_path(folder.models_of(str(garment)), method, seed)
            if not path.is_file():
                continue
            try:
                history = read_history(path, method)
            except ValueError as error:
                run.problems.append(without_folder(folder, error))
            else:
                histories += [replace(history, garment=str(garment))] if history else []
    return histories


@dataclass(frozen=True)
class SelectedRollOuts:
    """Roll-outs of one scene by method, as many frames as are finite, and the body where there is one."""

    run: Run
    cloths: dict[str, Trajectory]
    body: Trajectory | None

    @property
    def longest(self) -> Trajectory:
        """The roll-out with the most frames; its dt is nan where it has one."""
        return max(self.cloths.values(), key=lambda cloth: cloth.frames)


def select_roll_outs(
    folder: RunFolder, scene: str, methods: Sequence[str], seed: int | None = None
) -> SelectedRollOuts:
    """Read the methods' roll-outs of a scene.

    Args:
        folder: of the run.
        scene: as results.csv names it.
        methods: as results.csv names them.
        seed: of methods that have one; None takes the first that the run has.

    Raises:
        ResultsError: for a scene, method or seed that the run did not keep; the message names those it has.
    """
    run = read_run(folder)
    rows = run.frame[run.frame["case"] == ""]
    _demand_known(folder, "scene", scene, dict.fromkeys(rows["scene"]))
    of_scene = rows[rows["scene"] == scene]
    cloths = {}
    for method in methods:
        _demand_known(folder, f"method in {scene}", method, run.ordered(of_scene["method"]))
        of_method = of_scene[of_scene["method"] == method]
        seeds = sorted({int(s) for s in of_method["seed"]})
        chosen = seeds[0] if seed is None or not of_method["seeded"].any() else seed
        _demand_known(folder, f"seed of {method} in {scene}", str(chosen), map(str, seeds))
        path = folder.trajectory_path(scene, method, chosen)
        cloths[method] = _finite(run, run.roll_outs.cloth(scene, method, chosen), str(path))
    body_path = folder.trajectory_path(scene, "body")
    body = _finite(run, run.roll_outs.body(scene), str(body_path)) if body_path.is_file() else None
    return SelectedRollOuts(run, cloths, body)


def _finite(run: Run, trajectory: Trajectory | None, path: str) -> Trajectory:
    """Return the frames that are finite. Raises ResultsError where there are none."""
    if trajectory is None:
        raise ResultsError(run.problems[-1] if run.problems else f"{path}: this run kept no such roll-out")
    if not (trajectory := trajectory.finite()).frames:
        raise ResultsError(f"{path}: its first frame is not finite")
    return trajectory


def _demand_known(folder: RunFolder, kind: str, name: str, known: Iterable[str]) -> None:
    names = list(known)
    if name not in names:
        raise ResultsError(f"{folder.path}: no {kind} is called '{name}'; there are {', '.join(names)}")
