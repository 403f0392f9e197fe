"""The result files of a run: the only thing that a report may know of a benchmark.

Standard library alone, so that `--list` and the tests of the report start at once.
"""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import os
from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results.json_file import ResultsError, check_config, read_json

FORMAT = 4  # of run.json, results.csv and the cache; written into run.json
OLD = "written by an earlier version of this project; run the benchmark again in a new folder"
USABLE = ("ok", "stalled")  # statuses of cells that came to their last frame: their numbers count
STATUSES = ("ok", "diverged", "stalled", "timeout", "out-of-memory", "failed", "skipped")

# In this order methods stand in a report.
ROLES = (
    "reference", "bound", "baseline", "network", "ablation", "solver", "external", "reference-variant",
    "warm-started", "",
)  # fmt: skip

OF_TRAINING = ("cost/setup", "cost/train")  # [s] a network, on the machine that trained it
BEFORE_FRAMES = ("cost/data", *OF_TRAINING)  # [s] all that it costs before its first frame
REFERENCE_TOLERANCE = 1e-6  # of the reference's minimisations


def as_right(family: str, level: float | None) -> bool:
    """Whether simulations of that family and level could stand in the reference's place.

    From a moved start, with contact planes searched twice, or to a tolerance at least as small. Those of
    another time step could not: they solve another discrete problem; how far off that is is the time error.
    """
    if family == "simulation-tolerance":
        return level is not None and level <= REFERENCE_TOLERANCE
    return family in ("simulation-perturbed", "simulation-refrozen")


@dataclass(frozen=True)
class Row:
    """One measured number: a (suite, scene, method, seed, metric) and what came out.

    `value`, `expected`, `tolerance` and `uncertainty` are None where absent (an empty cell in the file); a
    skipped row has a reason and no value. `uncertainty`, in the unit of the value: how far it moves where
    another simulation as right as the reference takes its place, or its standard error as a sample of
    frames; `moved`: by how much each of those simulations changes it. `terms` names the energies of the
    scene, joined by "+".

    Of the scene: garment and motion, and its part: "whole", "clip", "loop" or "start"; empty without one.
    Of the method: its role (one of ROLES); family, shared by methods that differ by one number, and level,
    that number; base, the method that it varies or starts from; seeded, whether another seed gives another
    value; pairing_group, of variants of one method, which share the seed and are compared seed by seed.

    Raises ResultsError for an unknown status, a non-finite value called ok, or a skip without a reason.
    """

    suite: str
    scene: str
    method: str
    seed: int
    metric: str
    unit: str
    value: float | None = None
    status: str = "ok"
    reason: str = ""
    expected: float | None = None
    tolerance: float | None = None
    uncertainty: float | None = None
    moved: tuple[tuple[str, float], ...] = ()
    preset: str = ""
    commit: str = ""
    hardware: str = ""
    dtype: str = "float64"
    threads: int = 1
    terms: str = ""
    garment: str = ""
    motion: str = ""
    part: str = ""
    family: str = ""
    level: float | None = None
    role: str = ""
    base: str = ""
    seeded: bool = False
    pairing_group: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "moved", tuple(map(tuple, self.moved)))  # JSON gives lists
        label = f"{self.scene} x {self.method} / {self.metric}"
        if self.status not in STATUSES:
            raise ResultsError(f"row {label}: status '{self.status}' is none of {', '.join(STATUSES)}")
        if self.status == "skipped" and (self.value is not None or not self.reason):
            raise ResultsError(f"row {label}: a skipped row has a reason and no value")
        if self.status == "ok" and (self.value is None or not math.isfinite(self.value)):
            raise ResultsError(f"row {label}: status ok needs a finite value, got {self.value}")

    @property
    def passed(self) -> bool:
        """Whether the row counts as fine: ok, or skipped with its reason."""
        return self.status in ("ok", "skipped")


COLUMNS = tuple(field.name for field in dataclasses.fields(Row))
OPTIONAL_NUMBERS = ("value", "expected", "tolerance", "uncertainty", "level")
_WHOLE_NUMBERS = ("seed", "threads")
_TRUTHS = {"true": True, "false": False}
_NAMES = ("suite", "scene", "method", "metric", "garment", "motion", "part", "family", "role", "base")
LONGEST = 150  # bytes of such a name: files are named after it


def row_to_cells(row: Row) -> dict[str, str]:
    """The text of each cell. Numbers keep all their digits, so that reading gives back the same row."""
    cells = {}
    for name in COLUMNS:
        value = getattr(row, name)
        if value is None:
            cells[name] = ""
        elif name in OPTIONAL_NUMBERS:
            cells[name] = repr(float(value))
        elif isinstance(value, bool):
            cells[name] = str(value).lower()
        elif name == "moved":
            cells[name] = json.dumps(dict(value)) if value else ""
        else:
            cells[name] = " ".join(str(value).split())
    return cells


def cells_to_row(cells: dict[str, str]) -> Row:
    """The row written in the cells. Raises ResultsError for one that is no number, or name, as it should."""
    values: dict[str, Any] = dict(cells)
    try:
        for name in OPTIONAL_NUMBERS:
            values[name] = float(cells[name]) if cells[name] else None
        for name in _WHOLE_NUMBERS:
            values[name] = int(cells[name])
            if abs(values[name]) >= 1 << 63:
                raise ValueError("a number beyond 64 bits")
        for name in _NAMES:
            if not cells[name].isprintable() or len(cells[name].encode()) > LONGEST:
                raise ValueError(f"no name of at most {LONGEST} printable bytes")
        name = "seeded"
        values[name] = _TRUTHS[cells[name]]
        name = "moved"  # runs of before have none
        values[name] = tuple((str(k), float(v)) for k, v in json.loads(cells.get(name) or "{}").items())
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ResultsError(f"column {name}: {error}") from None
    return Row(**values)


def replacing(path: Path) -> AbstractContextManager[Path]:
    """See reference_sim.files.atomic_files, which is not loaded before something is written."""
    from reference_sim.files import atomic_files as whole_file

    return whole_file.replacing(path)


def model_path(models: Path, kind: str, seed: int) -> Path:
    """Where the model of that kind and seed lies."""
    return models / f"{kind}-seed{seed}.safetensors"


class RunFolder:
    """The files of one run under `path`. Making the object creates nothing."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    @property
    def config_path(self) -> Path:
        return self.path / "run.json"

    @property
    def rows_path(self) -> Path:
        return self.path / "results.csv"

    @property
    def frame_energies_path(self) -> Path:
        """See benchmarks.results.frame_energies."""
        return self.path / "frame_energies.csv"

    @property
    def report_path(self) -> Path:
        return self.path / "report.pdf"

    @property
    def page_path(self) -> Path:
        return self.path / "report.html"

    @property
    def tables(self) -> Path:
        return self.path / "tables"

    @property
    def figures(self) -> Path:
        return self.path / "figures"

    @property
    def models(self) -> Path:
        return self.path / "models"

    def models_of(self, garment: str) -> Path:
        """Where networks of that garment lie: those of the T-shirt, the usual one, in `models` itself."""
        return self.models if garment in ("", "tshirt") else self.models / garment

    @property
    def trajectories(self) -> Path:
        return self.path / "trajectories"

    @property
    def cache(self) -> Path:
        return self.path / "cache"

    def relative(self, path: Path) -> str:
        """The name of a file inside the folder, as the cache keeps it."""
        return path.relative_to(self.path).as_posix()

    def trajectory_path(self, scene: str, method: str, seed: int = 0) -> Path:
        """trajectories/<scene>/<method>.vtkhdf; a slash, as in "tshirt/walk", becomes a hyphen."""
        suffix = "" if seed == 0 else f"-seed{seed}"
        return self.trajectories / scene.replace("/", "-") / f"{method.replace('/', '-')}{suffix}.vtkhdf"

    def quasi_static_path(self, scene: str, method: str = "", seed: int = 0) -> Path:
        """A method's answer to each frame held still, beside its trajectory; without a method the
        simulator's, which no cell of the scene writes or removes.
        """
        return self.trajectory_path(scene, f"{method}-quasi-static" if method else "quasi-static", seed)

    def curves_path(self, scene: str, method: str, seed: int = 0) -> Path:
        """What was measured of each frame of a trajectory, beside it: name -> (T,) or (T,V)."""
        return self.trajectory_path(scene, method, seed).with_suffix(".npz")

    def clips_path(self, clips: str, method: str, part: int) -> Path:
        """Simulated mixed clips: name -> vertices (T,V,3) [m]."""
        return self.trajectory_path(clips, f"{method}-{part}").with_suffix(".npz")

    def start_path(self, scene: str) -> Path:
        """The settled start (V,3) [m] of a dressed scene."""
        return self.trajectory_path(scene, "settled").with_suffix(".npy")

    def rest_areas_path(self, scene: str) -> Path:
        """Areas (F,) [m^2] at rest of the faces of a dressed scene's garment."""
        return self.trajectory_path(scene, "rest_areas").with_suffix(".npy")

    def body_path(self, scene: str) -> Path:
        """The posed body (T,B,3) [m] of a dressed scene: a process that simulates then needs no torch."""
        return self.trajectory_path(scene, "body").with_suffix(".npy")

    def remove_parts(self) -> None:
        """Remove what a run that was killed was just writing: the folder is one run's at a time."""
        for path in [*self.path.rglob(".*.part*"), *self.path.rglob("*.vtkhdf.part")]:
            path.unlink(missing_ok=True)

    def write_config(self, config: dict[str, Any]) -> None:
        """Write run.json, with its format, whole or not at all."""
        config = {"format": FORMAT, **config}
        with replacing(self.config_path) as temporary:
            temporary.write_text(json.dumps(config, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")

    def read_config(self) -> dict[str, Any]:
        """The configuration. Raises ResultsError when run.json is absent or broken."""
        config = read_json(self.config_path)
        if config.get("format") != FORMAT:
            raise ResultsError(f"{self.config_path}: {OLD}")
        check_config(self.config_path, config)
        return config

    def changed(self, config: dict[str, Any]) -> list[str]:
        """Files of the run that are not as it wrote them; those that are gone are not named."""
        paths = {name: self.path / name for name in config.get("digests") or ()}
        return [
            name
            for name, path in paths.items()
            if path.is_file() and digest_of_file(path) != config["digests"][name]
        ]

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
        """All rows. Raises ResultsError naming file and line when the file is absent or broken."""
        try:
            stream = self.rows_path.open(newline="", encoding="utf-8")
        except FileNotFoundError:
            raise ResultsError(f"{self.rows_path}: no such file; is this the folder of a run?") from None
        with stream:
            try:
                return self._rows(stream)
            except (UnicodeDecodeError, csv.Error) as error:  # also for a cell of 131 kB
                raise ResultsError(f"{self.rows_path}: not readable as CSV in UTF-8 ({error})") from None

    def _rows(self, stream: Iterable[str]) -> list[Row]:
        rows = []
        reader = csv.DictReader(stream)
        if tuple(reader.fieldnames or ()) == COLUMNS[: COLUMNS.index("garment")]:
            raise ResultsError(f"{self.rows_path}: {OLD}")
        before = tuple(name for name in COLUMNS if name != "moved")
        if tuple(reader.fieldnames or ()) not in (COLUMNS, before):
            raise ResultsError(f"{self.rows_path}: line 1: the columns should be {','.join(COLUMNS)}")
        for cells in reader:
            line = f"{self.rows_path}: line {reader.line_num}"
            if None in cells or None in cells.values():
                raise ResultsError(f"{line}: {len(COLUMNS)} cells are due")
            try:
                rows.append(cells_to_row(cells))
            except ResultsError as error:
                raise ResultsError(f"{line}: {error}") from None
        return rows


def with_provenance(rows: Iterable[Row], **provenance: Any) -> list[Row]:
    """The rows with their provenance columns (preset, commit, hardware, ...) filled in.

    What an earlier run measured names its own, and keeps it.
    """
    return [
        dataclasses.replace(row, **{name: getattr(row, name) or value for name, value in provenance.items()})
        for row in rows
    ]
