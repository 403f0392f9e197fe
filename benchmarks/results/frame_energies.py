"""frame_energies.csv of a run: the energy of each judged frame by term, of garments in whole motions.

A line is a frame: scene, method, seed, seconds of the motion, then joules of each term and of their sum. A
term that a scene does not have is left empty. It holds what the paper draws over time: the reference,
baselines and networks. Curves of all else lie beside their trajectories; they are too large to be published.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results.row import ResultsError, Row
from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing

if TYPE_CHECKING:
    import numpy as np

ROLES = ("reference", "baseline", "network")
CELL = ("scene", "method", "seed", "seconds")
SECONDS = "judged/seconds"  # among the curves of a cell: of each frame, nan where it is not judged
ENERGY = "energy/"


def write(folder: RunFolder, rows: Iterable[Row]) -> None:
    """Write the file, whole or not at all, of all cells that take part; none where none does."""
    import pandas as pd

    cells = dict.fromkeys(
        (row.scene, row.method, row.seed)
        for row in rows
        if row.suite == "garments" and row.part == "whole" and row.role in ROLES
        if row.metric == "energy/total" and row.value is not None
    )
    curves = {cell: made for cell in cells if SECONDS in (made := _curves(folder.curves_path(*cell)))}
    terms = list(dict.fromkeys(name for energies in curves.values() for name in energies if name != SECONDS))
    if not terms:
        folder.frame_energies_path.unlink(missing_ok=True)
        return
    table = pd.concat([pd.DataFrame(dict(zip(CELL, cell)) | curves[cell]) for cell in curves])
    table = table.replace([math.inf, -math.inf], math.nan).dropna(subset=SECONDS)
    table["seconds"] = table[SECONDS].map("{:.4f}".format)
    with replacing(folder.frame_energies_path) as temporary:
        lines = table[[*CELL, *terms]]
        lines.to_csv(temporary, index=False, float_format="%.5g", lineterminator="\n")


def _curves(path: Path) -> dict[str, np.ndarray]:
    """Read seconds, and energies by term, of a cell; empty where somebody removed its file."""
    from reference_sim.files.array_file import read_arrays

    if not path.is_file():
        return {}
    arrays = read_arrays(path)
    kept = [name for name in arrays if name == SECONDS or name.startswith(ENERGY)]
    return {name.removeprefix(ENERGY): arrays[name] for name in kept}


def read(path: Path) -> tuple[list[str], list[list[str | int | float]]]:
    """Read columns and lines; nan where a cell is empty. Raises ResultsError: file, line and column."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            reader = csv.reader(stream)
            columns = next(reader, [])
            fits = tuple(columns[: len(CELL)]) == CELL and len(set(columns)) == len(columns)
            if not fits or len(columns) == len(CELL):
                expected = ",".join(CELL)
                raise ResultsError(
                    f"{path}: line 1: the columns should be {expected} and energies, each once"
                )
            return columns, [_line(f"{path}: line {reader.line_num}", columns, cells) for cells in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ResultsError(f"{path}: not readable as CSV in UTF-8 ({error})") from None


def _line(where: str, columns: list[str], cells: list[str]) -> list[str | int | float]:
    if len(cells) != len(columns):
        raise ResultsError(f"{where}: {len(columns)} cells are expected")
    line: list[str | int | float] = [*cells[:2]]
    for name, cell in list(zip(columns, cells))[2:]:
        try:
            number = int(cell) if name == "seed" else float(cell or "nan")
            if (cell and not math.isfinite(number)) or (name == "seed" and abs(number) >= 1 << 63):
                raise ValueError
            line.append(number)
        except ValueError:
            raise ResultsError(f"{where}: column {name}: '{cell[:40]}' is no number") from None
    return line
