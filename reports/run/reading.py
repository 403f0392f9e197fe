"""Reading of a run's folder: the one module of the reports that opens what a run has left."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd

from benchmarks.results import run_folder
from benchmarks.results.protocol import one_protocol
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder, model_path
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
