"""One measured number of a run: a line of results.csv, and what its columns mean."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reference_sim.given_files import demand_file


class ResultsError(ValueError):
    """A run folder or a file of it is absent or broken; the message names it."""


def read_json(path: Path) -> dict[str, Any]:
    """Read the JSON object in a file. Raises ResultsError."""
    try:
        value = json.loads(demand_file(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ResultsError(f"{path}: no such file; is this the folder of a run?") from None
    except (ValueError, RecursionError, OSError) as error:  # also for a number of 5000 digits
        raise ResultsError(f"{path}: not readable as JSON ({' '.join(str(error).split())})") from None
    if not isinstance(value, dict):
        raise ResultsError(f"{path}: holds no JSON object")
    return value


USABLE = ("ok", "stalled")  # statuses of cells that came to their last frame: their numbers count
STATUSES = ("ok", "diverged", "stalled", "timeout", "out-of-memory", "failed", "skipped")

# In this order methods stand in a report. A bound is of runs before such methods went.
ROLES = (
    "reference", "bound", "baseline", "network", "ablation", "solver", "external", "reference-variant",
    "warm-started", "",
)  # fmt: skip

# [s] all that a network costs before its first frame
BEFORE_FRAMES = ("cost/data", "cost/setup", "cost/train")
DECLARED = "declared by its author, not measured"  # reason of such a run time
PRETRAINED = "pretrained network"  # how the remark begins that a row's network is of a file


@dataclass(frozen=True)
class Row:
    """One measured number: a (suite, scene, method, seed, metric) and its value.

    Attributes:
        suite, scene, method, seed, metric: the key of the row.
        unit, value: the number; None (an empty cell) where there is none.
        status, reason: `ok`, `diverged`, `stalled`, `timeout`, `out-of-memory`, `failed` or `skipped`,
            and why. A skipped row has a reason and no value.
        expected, tolerance: of a validation case.
        uncertainty: noise of the value, of what the start of the reference changes, or its standard error
            as a sample of frames, in the unit of the value.
        moved: change of the value by each of the reference's family in its place, 4 digits; as JSON.
        preset, commit, hardware, dtype, threads: origin.
        protocol: number of the protocol; `own` where scene, metric or settings are a user's.
        terms: energies of the scene, joined by `+`.
        garment, motion, part: of the scene; the part is `whole`, `clip`, `loop` or `start`.
        family, level: name shared by methods that differ by one number, and that number.
        role: place of the method in tables and plots, as `reference`, `solver`, `network`, `baseline`.
        base: method that this one varies or starts from.
        seeded: whether another seed gives another value.
        pairing_group: name shared by variants of one method, compared seed by seed.

    Raises:
        ResultsError: unknown status, non-finite value called ok, or skip without a reason.
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
    protocol: str = ""
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
        moved = sorted((name, float(f"{change:.4g}")) for name, change in self.moved)  # JSON gives lists
        object.__setattr__(self, "moved", tuple(moved))
        if self.status not in STATUSES:
            raise self._error(f"status '{self.status}' is none of {', '.join(STATUSES)}")
        if self.status == "skipped" and (self.value is not None or not self.reason):
            raise self._error("a skipped row has a reason and no value")
        if self.status == "ok" and (self.value is None or not math.isfinite(self.value)):
            raise self._error(f"status ok needs a finite value, got {self.value}")

    def _error(self, problem: str) -> ResultsError:
        return ResultsError(f"row {self.scene} x {self.method} / {self.metric}: {problem}")

    @property
    def pretrained(self) -> str:
        """Remark on the row's network where it is of a file; else empty."""
        remark = re.search(rf"(?:^|; )({PRETRAINED} .*)", self.reason)
        return remark[1] if remark else ""


COLUMNS = tuple(field.name for field in dataclasses.fields(Row))
OPTIONAL_NUMBERS = ("value", "expected", "tolerance", "uncertainty", "level")
_NO_FORMULA = re.compile(r"-|[+-]?[0-9.]+(e[+-]?[0-9]+)?")  # a dash, or a number


def cell_text(text: str) -> str:
    """Return a text for a cell of a CSV file, which no program takes for a formula.

    >>> cell_text("=1+1"), cell_text("-"), cell_text("-0.5")
    ("'=1+1", '-', '-0.5')
    """
    if text.startswith(("=", "@")) or (text.startswith(("+", "-")) and not _NO_FORMULA.fullmatch(text)):
        return f"'{text}"
    return text


def row_to_cells(row: Row) -> dict[str, str]:
    """Return the text of each cell: numbers with all digits, texts by single spaces and `cell_text`."""
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
            cells[name] = cell_text(" ".join(str(value).split()))
    return cells


def cells_to_row(cells: dict[str, str]) -> Row:
    """Return the row written in the cells. Raises ResultsError for a number that is none."""
    values: dict[str, Any] = dict(cells)
    try:
        for name in OPTIONAL_NUMBERS:
            values[name] = float(cells[name]) if cells[name] else None
        for name in ("seed", "threads"):
            values[name] = int(cells[name])
        values["seeded"] = {"true": True, "false": False}[cells["seeded"]]
        moved = json.loads(cells["moved"]) if cells["moved"] else {}
        values["moved"] = tuple((str(k), float(v)) for k, v in moved.items())
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ResultsError(f"{type(error).__name__}: {error}") from None
    return Row(**values)
