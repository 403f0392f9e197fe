"""A table: columns, rows of numbers and texts, and its CSV file.

It knows nothing of the page it is printed on: the CSV keeps nine digits, the PDF three.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from benchmarks.results import replacing
from reports.numbers import CSV_DASH, csv_number
from reports.summary import Mean

Cell = float | int | str | Mean | None


@dataclass(frozen=True)
class Column:
    """A column: its name in the CSV, its title and unit in the PDF."""

    name: str
    title: str
    unit: str = ""


@dataclass(frozen=True)
class Table:
    """Columns and rows; each row has one cell per column."""

    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def write_csv(self, folder: Path) -> Path:
        """Write <folder>/<name>.csv, whole or not at all. A mean with seeds gets a column for its spread."""
        path = folder / f"{self.name}.csv"
        spread = [any(isinstance(row[i], Mean) for row in self.rows) for i in range(len(self.columns))]
        header = []
        for column, is_mean in zip(self.columns, spread):
            header.append(_csv_title(column))
            header += [f"{column.name}_spread"] if is_mean else []
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(header)
            for row in self.rows:
                line: list[str] = []
                for cell, is_mean in zip(row, spread):
                    line += _csv_cells(cell, is_mean)
                writer.writerow(line)
        return path


def _csv_title(column: Column) -> str:
    return f"{column.name} [{column.unit}]" if column.unit else column.name


def _csv_cells(cell: Cell, is_mean: bool) -> list[str]:
    if isinstance(cell, Mean):
        return [csv_number(cell.value), csv_number(cell.spread)]
    if isinstance(cell, str):
        text = cell or CSV_DASH
    elif isinstance(cell, int):
        text = str(cell)
    else:
        text = csv_number(cell)
    return [text, CSV_DASH] if is_mean else [text]
