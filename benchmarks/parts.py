"""What the speed benchmarks share: parts made of cases, each in a process of its own, and two result files.

A part is a module with CASES (names) and measure(case, settings) -> rows. Cases run one after another, so
that the peak memory of each is its own and nothing runs beside it.
"""

from __future__ import annotations

import csv
import importlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from .guarded import Broken, Guarded
from .results import replacing
from .workers import one_line

Row = tuple[str, object, str]  # metric, value, unit
COLUMNS = ("part", "case", "metric", "value", "unit")


def described(parts: Mapping[str, str]) -> str:
    """The parts as lines of a help text."""
    return "\n\nparts:\n" + "\n".join(f"  {name:<11} {what}" for name, what in parts.items())


def chosen(words: str, parts: Mapping[str, str]) -> list[str]:
    """The parts named in "a,b". Raises ValueError for one that is not there."""
    names = [name.strip() for name in words.split(",")]
    for name in names:
        if name not in parts:
            raise ValueError(f"unknown part '{name}': choose from {', '.join(parts)}")
    return names


def make_folder(folder: Path) -> None:
    """Make the folder of the results, before anything is measured. Raises ValueError where that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise ValueError(f"--out {folder}: cannot be made ({reason}); name another folder") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ValueError(f"--out {folder}: cannot be written to; name another folder")


def run_parts(
    package: str, parts: Sequence[str], settings: Any, folder: Path | None, *, device: str = "cpu",
    **facts: Any,
) -> int:  # fmt: skip
    """Measure those parts of the package, and write their rows into the folder, where one is named.

    Returns the exit status: 1 when a case failed, 130 after an interrupt. What was measured until then, or
    until anything raised, is written all the same, and said to be incomplete.
    """
    rows: list[dict[str, object]] = []
    complete = False
    try:
        for row in measure_parts(package, parts, settings):
            rows.append(row)
        complete = True
    except KeyboardInterrupt:
        kept = f"; {len(rows)} rows lie in {folder}" if folder is not None and rows else ""
        print(f"{package}: interrupted{kept}", file=sys.stderr)
        return 130
    finally:
        if folder is not None and rows:
            write(folder, package.rpartition(".")[2], rows, device=device, complete=complete, **facts)
    return int(any(row["metric"] == "failed" for row in rows))


def measure_parts(package: str, parts: Sequence[str], settings: Any) -> Iterator[dict[str, object]]:
    """The rows of those parts of the package, each printed when it is there. A case that fails, or whose
    process dies, is a row with metric "failed".
    """
    for part in parts:
        module = f"{package}.{part}"
        for case in importlib.import_module(module).CASES:
            for metric, value, unit in _in_own_process(module, case, settings):
                value = float(f"{value:.4g}") if isinstance(value, float) else value
                print(f"{part:<11} {case:<30} {metric:<34} {value} {unit}", flush=True)
                yield dict(zip(COLUMNS, (part, case, metric, value, unit)))


def _in_own_process(module: str, case: str, settings: Any) -> list[Row]:
    with Guarded() as worker:
        try:
            rows: list[Row] = worker.call(_report, module, case, settings, seconds=None)
        except Broken as broken:
            rows = [("failed", str(broken), "")]
    return rows


def _report(module: str, case: str, settings: Any) -> list[Row]:
    """In the process of the case: its rows, and the peak memory of the process."""
    from .cell import peak_memory

    measure: Callable[[str, Any], list[Row]] = importlib.import_module(module).measure
    try:
        rows = measure(case, settings)
    except Exception as error:
        rows = [("failed", one_line(error), "")]
    return [*rows, ("peak memory of the process", peak_memory(), "MB")]


def write(
    folder: Path, name: str, rows: Sequence[Mapping[str, object]], *, device: str = "cpu", **facts: Any
) -> None:
    """<name>.csv with the rows, and <name>.json with where they come from and these further facts."""
    from .provenance import commit, hardware, versions

    write_table(folder / f"{name}.csv", COLUMNS, rows)
    known = {"commit": commit(), "hardware": hardware(device), "versions": versions(), "threads": 1, **facts}
    with replacing(folder / f"{name}.json") as path:
        path.write_text(json.dumps(known, indent=2) + "\n")


def write_table(path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, object]]) -> None:
    """A CSV file, whole or not at all; what a row lacks is an empty cell."""
    with replacing(path) as temporary, temporary.open("w", newline="") as file:
        table = csv.DictWriter(file, columns)
        table.writeheader()
        table.writerows(rows)
