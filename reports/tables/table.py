"""A table: columns, rows of numbers and texts, and its CSV file, which keeps nine digits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.row import cell_text
from reference_sim.files.atomic_files import replacing
from reports.statistics.effects import Effect
from reports.statistics.means_and_spreads import Mean
from reports.tables.number_texts import CSV_DASH, csv_number

ROUNDING = {"dynamics/amplitude": 1e-4}  # a network's float32 positions alone move a hem by 1e-6 to 1e-5
EFFECT_PARTS = ("kind", "low", "high", "covers")
Cell = float | int | str | Mean | Effect | None


@dataclass(frozen=True)
class Column:
    """A column: its name in the CSV, its title and unit in the PDF, and how it is set there.

    text: words, set from the left; method: names of methods, printed by their labels. digits: of its numbers;
    trim: without zeros at their end; mixed: of several units, whose points need not stand in a column.
    rounding: size below which a number is rounding error and printed as 0; the CSV keeps it.
    """

    name: str
    title: str
    unit: str = ""
    text: bool = False
    method: bool = False
    digits: int = 3
    trim: bool = False
    mixed: bool = False
    rounding: float = 0.0

    @property
    def unit_above(self) -> str:
        """Unit in the column's heading; a duration is printed with a unit of its own."""
        return "" if self.unit == "s" else self.unit


METHOD = Column("method", "Method", text=True, method=True)
GARMENT, SCENE, SUITE = (Column(name, name.capitalize(), text=True) for name in ("garment", "scene", "suite"))


@dataclass(frozen=True)
class Table:
    """Columns and rows; each row has one cell per column.

    grouped_by: columns that become headings in the PDF. references: label and texts by column of rows that
    the paper printed; they are in no CSV.
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    grouped_by: tuple[str, ...] = ()
    references: tuple[tuple[str, dict[str, str]], ...] = ()
    note: str = ""

    def write_csv(self, folder: Path) -> Path:
        """Write <folder>/<name>.csv whole or not at all; return its path.

        A mean gets a column for its spread over seeds and, where there is any, one for its uncertainty and
        one for the roll-outs that it lacks; an effect gets columns for its kind and its interval.
        """
        path = folder / f"{self.name}.csv"
        texts: dict[str, list[str]] = {}
        for column, cells in zip(self.columns, zip(*self.rows)):
            title = f"{column.name} [{column.unit}]" if column.unit else column.name
            texts[title] = [_csv_text(cell) for cell in cells]
            if any(isinstance(cell, Mean) for cell in cells):
                spreads = [cell.spread if isinstance(cell, Mean) else None for cell in cells]
                texts[f"{column.name}_spread"] = [csv_number(spread) for spread in spreads]
                moved = [cell.uncertainty if isinstance(cell, Mean) else None for cell in cells]
                if any(x is not None for x in moved):
                    texts[f"{column.name}_uncertainty"] = [csv_number(x) for x in moved]
                missing = [cell.missing if isinstance(cell, Mean) else 0 for cell in cells]
                if any(missing):
                    texts[f"{column.name}_lacking"] = [str(count) for count in missing]
            if any(isinstance(cell, Effect) for cell in cells):
                parts = zip(*map(_parts_of_effect, cells))
                texts |= {f"{column.name}_{part}": list(cell) for part, cell in zip(EFFECT_PARTS, parts)}
        with replacing(path) as temporary:
            pd.DataFrame(texts).to_csv(temporary, index=False, lineterminator="\n")
        return path


def metric_column(metric: Metric) -> Column:
    """Return the column of a metric."""
    unit = "" if metric.unit == "1" else metric.unit
    return Column(metric.name, metric.title, unit, rounding=ROUNDING.get(metric.name, 0.0))


def table(
    name: str, columns: Sequence[Column], rows: Sequence[tuple[Cell, ...]], caption: str = "", **more: Any
) -> list[Table]:
    """Return the table in a list, which is empty where the table has no rows."""
    return [Table(name, tuple(columns), tuple(rows), caption, **more)] if rows else []


def _csv_text(cell: Cell) -> str:
    if isinstance(cell, Mean):
        return csv_number(cell.value)
    if isinstance(cell, Effect):
        return csv_number(cell.shown)
    if isinstance(cell, str):
        return cell_text(cell) or CSV_DASH
    return str(cell) if isinstance(cell, int) or cell == math.inf else csv_number(cell)


def _parts_of_effect(cell: Cell) -> tuple[str, ...]:
    """Return the texts of EFFECT_PARTS."""
    if not isinstance(cell, Effect):
        return (CSV_DASH,) * len(EFFECT_PARTS)
    low, high = cell.interval or (None, None)
    return cell.scale, csv_number(low), csv_number(high), cell.covers or CSV_DASH
