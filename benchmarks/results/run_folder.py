"""The folder of a run: places of its files; run.json, results.csv, frame_energies.csv."""

from __future__ import annotations

import csv
import gzip
import json
import math
import os
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.provenance import digest_of_file
from benchmarks.results.row import COLUMNS, ResultsError, Row, cells_to_row, read_json, row_to_cells
from reference_sim.files.atomic_files import replacing
from reference_sim.given_files import demand_file

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

FORMAT = 4  # of run.json, results.csv and the cache; written into run.json
OLD = "written by an earlier version of this project; run the benchmark again in a new folder"
# Of run.json: with other such entries, two runs have no number in common.
OF_SCENES = ("preset", "preset_values", "body", "garment")


NOT_TAKEN = r"(?!body$|.*quasi-static$)"  # by the runner's own files: names of methods


def flat(name: str) -> str:
    """Return a name as part of a path.

    >>> flat("tshirt/walk")
    'tshirt-walk'
    """
    return name.replace("/", "-")


def cell_name(scene: str, method: str, seed: int = 0) -> str:
    """Return <scene>/<method>, and the seed where it is not 0: part of paths and of ids."""
    return f"{flat(scene)}/{flat(method)}" + (f"-seed{seed}" if seed else "")


def model_path(models: Path, kind: str, seed: int) -> Path:
    """Return the path of the model of that kind and seed."""
    return models / f"{kind}-seed{seed}.safetensors"


def find_file(path: Path) -> Path:
    """Return the path of a file, or of the compressed copy that a published run has."""
    copy = path.with_name(f"{path.name}.gz")
    return copy if copy.is_file() and not path.is_file() else path


class RunFolder:
    """The files of one run, and folders of its networks, outcomes and report.

    Making the object creates nothing.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = folder = Path(path)
        self.config_path, self.rows_path = folder / "run.json", folder / "results.csv"
        self.frame_energies_path = folder / "frame_energies.csv"
        self.report_path, self.page_path = folder / "report.pdf", folder / "report.html"
        self.tables, self.figures, self.models = folder / "tables", folder / "figures", folder / "models"
        self.trajectories, self.cache = folder / "trajectories", folder / "cache"

    def models_of(self, garment: str) -> Path:
        """Return the folder of networks of that garment: of the T-shirt `models` itself."""
        return self.models if garment in ("", "tshirt") else self.models / garment

    def relative(self, path: Path) -> str:
        """Return the name of a file inside the folder, as the cache keeps it."""
        return path.relative_to(self.path).as_posix()

    def trajectory_path(self, scene: str, method: str, seed: int = 0) -> Path:
        """Return trajectories/<scene>/<method>.vtkhdf; a slash becomes a hyphen."""
        return self.trajectories / f"{cell_name(scene, method, seed)}.vtkhdf"

    def quasi_static_path(self, scene: str, method: str = "", seed: int = 0) -> Path:
        """Return the path of a method's quasi-static solution, beside its trajectory.

        Without a method: the simulator's, which no cell of the scene writes or removes.
        """
        return self.trajectory_path(scene, f"{method}-quasi-static" if method else "quasi-static", seed)

    def curves_path(self, scene: str, method: str, seed: int = 0) -> Path:
        """Return the path of curves of metrics: name -> (T,) or (T,V)."""
        return self.trajectory_path(scene, method, seed).with_suffix(".npz")

    def start_path(self, scene: str) -> Path:
        """Return the path of the settled start (V,3) [m] of a dressed scene."""
        return self.trajectory_path(scene, "settled").with_suffix(".npy")

    def remove_parts(self) -> None:
        """Remove what a killed run was just writing: the folder is one run's at a time."""
        for path in [*self.path.rglob(".*.part*"), *self.path.rglob("*.vtkhdf.part")]:
            path.unlink(missing_ok=True)

    def write_config(self, config: dict[str, Any]) -> None:
        """Write run.json, with its format, whole or not at all."""
        text = json.dumps({"format": FORMAT, **config}, indent=2, ensure_ascii=False)
        with replacing(self.config_path) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    def read_config(self) -> dict[str, Any]:
        """Read run.json. Raises ResultsError: absent, broken, or of another format."""
        config = read_json(self.config_path)
        if config.get("format") != FORMAT:
            raise ResultsError(f"{self.config_path}: {OLD}")
        return config

    def find_changes(self, digests: Mapping[str, str]) -> dict[str, str]:
        """Return name -> gone or damaged, of files that are not as the run wrote them."""
        paths = {name: find_file(self.path / name) for name in digests}
        losses = {name: "gone" for name, path in paths.items() if not path.is_file()}
        present = {name: digest_of_file(path) for name, path in paths.items() if name not in losses}
        return losses | {name: "damaged" for name, now in present.items() if now != digests[name]}

    def write_rows(self, rows: Iterable[Row]) -> None:
        """Write results.csv whole or not at all."""
        with (
            replacing(self.rows_path) as temporary,
            temporary.open("w", newline="", encoding="utf-8") as stream,
        ):
            writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(row_to_cells(row) for row in rows)

    def read_rows(self) -> list[Row]:
        """All rows. Raises ResultsError with file and line: absent or broken."""
        try:
            path = demand_file(find_file(self.rows_path))
            read = gzip.open if path.suffix == ".gz" else open
            with read(path, "rt", newline="", encoding="utf-8") as stream:
                reader = csv.reader(stream)
                if next(reader, ()) != list(COLUMNS):
                    raise ResultsError(f"the columns should be {','.join(COLUMNS)}")
                lines = filter(None, reader)  # a blank line is no row
                return [cells_to_row(dict(zip(COLUMNS, cells, strict=True))) for cells in lines]
        except FileNotFoundError:
            raise ResultsError(f"{self.rows_path}: no such file; is this the folder of a run?") from None
        except (ValueError, csv.Error, EOFError, gzip.BadGzipFile, zlib.error) as error:
            # Not UTF-8, a cell of 131 kB, another number of cells, a damaged copy.
            raise ResultsError(f"{self.rows_path}: line {reader.line_num}: {error}") from None


ROLES = ("reference", "baseline", "network")
CELL = ("scene", "method", "seed", "seconds")
SECONDS = "judged/seconds"  # curve of a cell, nan where a frame is not judged
ENERGY = "energy/"


def write_frame_energies(folder: RunFolder, rows: Iterable[Row]) -> None:
    """Write frame_energies.csv whole or not at all: energies of each evaluated frame by term.

    A line is a frame: scene, method, seed, seconds of the motion, then joules of each term and of their
    sum. A term that a scene does not have is left empty. It has whole motions in garments by reference,
    baselines and networks; without any there is no file.
    """
    import pandas as pd

    cells = dict.fromkeys(
        (row.scene, row.method, row.seed)
        for row in rows
        if row.suite == "garments" and row.part == "whole" and row.role in ROLES
        if row.metric == "energy/total" and row.value is not None
    )
    curves = {cell: _curves(folder.curves_path(*cell)) for cell in cells}
    curves = {cell: energies for cell, energies in curves.items() if SECONDS in energies}
    names = (name for energies in curves.values() for name in energies if name != SECONDS)
    terms = list(dict.fromkeys(names))
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
    """Read seconds, and energies by term, of a cell; empty without its file."""
    from reference_sim.files.array_file import read_arrays

    if not path.is_file():
        return {}
    arrays = read_arrays(path)
    names = [name for name in arrays if name == SECONDS or name.startswith(ENERGY)]
    return {name.removeprefix(ENERGY): arrays[name] for name in names}


def read_frame_energies(path: Path) -> pd.DataFrame:
    """Return the lines of frame_energies.csv, nan for empty cells; none without it.

    Raises:
        ResultsError: a file of other columns, or with a cell that is no number.
    """
    import pandas as pd

    if not path.is_file():
        return pd.DataFrame()
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
        columns = list(table)
        if tuple(columns[: len(CELL)]) != CELL or len(columns) == len(CELL):
            raise ValueError(f"the columns should be {','.join(CELL)} and energies")
        return table.replace("", "nan").astype({"seed": int, **dict.fromkeys(columns[3:], float)})
    except (OSError, ValueError, EOFError, zlib.error) as error:
        reason = " ".join(str(error).split())
        raise ResultsError(f"{path}: not readable as CSV in UTF-8 ({reason})") from None
