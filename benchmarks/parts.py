"""What the speed benchmarks share: parts made of cases, each in a process of its own, and two result files.

A part is a module with CASES (names) and measure(case, settings) -> rows. Cases run one after another, so
that the peak memory of each is its own and nothing runs beside it.
"""

from __future__ import annotations

import csv
import importlib
import json
import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from .results import replacing

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


def measure_parts(package: str, parts: Sequence[str], settings: Any) -> list[dict[str, object]]:
    """All rows of those parts of the package, each printed when it is there. A case that fails, or whose
    process dies, is a row with metric "failed".
    """
    rows: list[dict[str, object]] = []
    for part in parts:
        module = f"{package}.{part}"
        for case in importlib.import_module(module).CASES:
            for metric, value, unit in _in_own_process(module, case, settings):
                value = float(f"{value:.4g}") if isinstance(value, float) else value
                print(f"{part:<11} {case:<30} {metric:<34} {value} {unit}", flush=True)
                rows.append(dict(zip(COLUMNS, (part, case, metric, value, unit))))
    return rows


def failed(rows: Sequence[Mapping[str, object]]) -> bool:
    """Whether any case did."""
    return any(row["metric"] == "failed" for row in rows)


def _in_own_process(module: str, case: str, settings: Any) -> Iterator[Row]:
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_report, args=(module, case, settings, sender))
    child.start()
    sender.close()
    try:
        yield from receiver.recv()
    except EOFError:
        child.join()
        yield "failed", f"the process ended with status {child.exitcode}", ""
    child.join()


def _report(module: str, case: str, settings: Any, sender: Connection) -> None:
    """In the process of the case: measure it and send its rows, with the peak memory of the process."""
    from .cell import peak_memory

    measure: Callable[[str, Any], list[Row]] = importlib.import_module(module).measure
    try:
        rows = measure(case, settings)
    except Exception as error:
        rows = [("failed", " ".join(f"{type(error).__name__}: {error}".split()), "")]
    sender.send([*rows, ("peak memory of the process", peak_memory(), "MB")])


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
