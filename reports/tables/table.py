"""A table: columns, rows of numbers and texts, its cells as printed, and its CSV file."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.row import cell_text
from reference_sim.files.atomic_files import replacing
from reports.finished_run import Run
from reports.statistics.effects import DIFFERENCE, RANGE, RATIO, Effect
from reports.statistics.means_and_spreads import Mean
from snug.motion.library import CLIPS, clip_of

DASH = "–"
CSV_DASH = "-"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3, *, trim: bool = False) -> str:
    """Return `value` to `digits` significant digits, at least to the unit; a dash if absent or not finite.

    `trim` leaves out zeros at the end, for numbers that are exact.

    >>> number(0.064349), number(1734.0), number(2.5e-7), number(None)
    ('0.0643', '1,734', '2.50×10⁻⁷', '–')
    """
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= exponent < 6:
        text = f"{value:,.{max(digits - 1 - exponent, 0)}f}".replace("-", "−")
        return _trim(text) if trim else text
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    mantissa = _trim(mantissa) if trim else mantissa
    return f"{mantissa.replace('-', '−')}×10{str(int(power)).translate(_RAISED)}"


def _trim(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def format_spread(value: float | None, spread: float | None) -> str:
    """Return a number with its spread to two digits, without ± where there is no spread.

    >>> format_spread(0.5, 0.0123)
    '0.500 ± 0.012'
    """
    if spread is None or not math.isfinite(spread) or number(value) == DASH:
        return number(value)
    return f"{number(value)} ± {number(spread, 2)}"


def duration(seconds: float | None) -> str:
    """Return a duration in s, min or h; a dash if absent.

    >>> duration(75.0), duration(402.0), duration(104400.0)
    ('75.0 s', '6.70 min', '29.0 h')
    """
    if seconds is None or not math.isfinite(seconds):
        return DASH
    for limit, size, unit in ((120.0, 1.0, "s"), (7200.0, 60.0, "min")):
        if abs(seconds) < limit:
            return f"{number(seconds / size)} {unit}"
    return f"{number(seconds / 3600.0)} h"


def csv_number(value: float | None) -> str:
    """Return nine digits for a file; a dash if absent."""
    if value is None or not math.isfinite(value):
        return CSV_DASH
    return f"{value:.9g}"


def say_where(scenes: Collection[str]) -> str:
    """Return "in 1 scene", "in 2 scenes" or, of liveliest parts alone, "in 2 clips"."""
    kind = "clip" if all(name.endswith("@clip") for name in scenes) else "scene"
    return f"in {len(scenes)} {kind}{'' if len(scenes) == 1 else 's'}"


def name_scene(scene: str) -> str:
    """Return a scene by its garment, what a recorded motion shows, and the motion.

    >>> name_scene("tshirt/07_02@clip"), name_scene("push_recovery")
    ('tshirt: walk, 1.5 m/s, 07_02, clip', 'push recovery')
    """
    garment, _, motion = scene.rpartition("/")
    name, _, part = motion.partition("@")
    clip = CLIPS.get(clip_of(name))
    motions = (clip.content, name) if clip else (name.replace("_", " "),)
    return f"{garment}: " * bool(garment) + ", ".join(filter(None, (*motions, part)))


def join(items: Sequence[str]) -> str:
    """Return the words as "a, b and c".

    >>> join(["a", "b", "c"]), join(["a"]), join([])
    ('a, b and c', 'a', '')
    """
    return " and ".join(filter(None, [", ".join(items[:-1]), *items[-1:]]))


ROUNDING = {"dynamics/amplitude": 1e-4}  # a network's float32 positions alone move a hem by 1e-6 to 1e-5
EFFECT_PARTS = ("kind", "low", "high", "covers")
Cell = float | int | str | Mean | Effect | None
Cells = tuple[Cell, ...]  # of a row


@dataclass(frozen=True)
class Column:
    """A column: its name in the CSV, its title and unit in the PDF, and how it is set there.

    text: words, set from the left; method: names of methods, printed by their labels. digits: of its
    numbers; trim: without zeros at their end.
    rounding: size below which a number is rounding error and printed as 0; the CSV keeps it.
    """

    name: str
    title: str
    unit: str = ""
    text: bool = False
    method: bool = False
    digits: int = 3
    trim: bool = False
    rounding: float = 0.0

    @property
    def unit_above(self) -> str:
        """Unit in the column's heading; a duration is printed with a unit of its own."""
        return "" if self.unit == "s" else self.unit


METHOD = Column("method", "Method", text=True, method=True)
GARMENT, SCENE, SUITE = (
    Column(name, name.capitalize(), text=True) for name in ("garment", "scene", "suite")
)


@dataclass(frozen=True)
class Table:
    """Columns and rows; each row has one cell per column.

    grouped_by: columns that become headings in the PDF.
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[Cells, ...]
    caption: str = ""
    grouped_by: tuple[str, ...] = ()
    note: str = ""

    def drop_empty(self) -> Table:
        """Return the table without the columns in which no row has a cell."""
        places = [k for k, cells in enumerate(zip(*self.rows)) if any(c is not None for c in cells)]
        rows = tuple(tuple(row[k] for k in places) for row in self.rows)
        return replace(self, columns=tuple(self.columns[k] for k in places), rows=rows)

    def write_csv(self, folder: Path) -> None:
        """Write <folder>/<name>.csv whole or not at all.

        A mean gets a column for its spread over seeds and, where there is any, one for its uncertainty
        and one for the roll-outs that it lacks; an effect gets columns for its kind and its interval.
        """
        texts: dict[str, list[str]] = {}
        for column, cells in zip(self.columns, zip(*self.rows)):
            title = f"{column.name} [{column.unit}]" if column.unit else column.name
            texts[title] = [_csv_text(cell) for cell in cells]
            means = [cell if isinstance(cell, Mean) else None for cell in cells]
            if any(means):
                texts[f"{column.name}_spread"] = [csv_number(m.spread if m else None) for m in means]
                moved = [m.uncertainty if m else None for m in means]
                if any(x is not None for x in moved):
                    texts[f"{column.name}_uncertainty"] = [csv_number(x) for x in moved]
                counts = [m.missing if m else 0 for m in means]
                if any(counts):
                    texts[f"{column.name}_lacking"] = [str(count) for count in counts]
            if any(isinstance(cell, Effect) for cell in cells):
                parts = zip(*map(_parts_of_effect, cells))
                texts |= {f"{column.name}_{part}": list(cell) for part, cell in zip(EFFECT_PARTS, parts)}
        with replacing(folder / f"{self.name}.csv") as temporary:
            pd.DataFrame(texts).to_csv(temporary, index=False, lineterminator="\n")


def metric_column(metric: Metric) -> Column:
    """Return the column of a metric."""
    unit = "" if metric.unit == "1" else metric.unit
    return Column(metric.name, metric.title, unit, rounding=ROUNDING.get(metric.name, 0.0))


def table(
    name: str,
    columns: Sequence[Column],
    rows: Sequence[Cells],
    caption: str = "",
    **fields: Any,
) -> list[Table]:
    """Return the table in a list, which is empty where the table has no rows."""
    return [Table(name, tuple(columns), tuple(rows), caption, **fields)] if rows else []


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


CellText = dict[str, str]  # text, spread, mark
REMARKS = {
    "*": "* A mean over fewer scenes or seeds than in the other rows, for want of the rest.",
    "†": "† The solver left some frames unconverged.",
    "‡": "‡ The interval is over seeds alone: there is one motion, or motions make no difference.",
    "§": "§ The interval is over motions alone: there is no second seed, or seeds make no difference.",
    "#": "# The range over motions and seeds.",
}
SPREAD = "±: standard deviation over seeds or, if larger, noise of the reference or a sample's error."
_COVERED = {"seeds": "‡", "motions": "§", RANGE: "#"}
# What is asked for in more digits and lies below it is an error: two digits say enough.
SMALL = 1e-3


def remarks_below(table: Table, lines: Sequence[Sequence[CellText]]) -> str:
    """Return the remarks below a table: its note, the meaning of its ± and of the marks in its lines."""
    remarks = [table.note] if table.note else []
    if any(isinstance(cell, Mean) and cell.spread_or_uncertainty for row in table.rows for cell in row):
        remarks.append(SPREAD)
    marks = {mark for line in lines for cell in line for mark in cell["mark"]}
    return " ".join([*remarks, *(REMARKS[mark] for mark in sorted(marks))])


def column_texts(run: Run, column: Column, cells: Sequence[Cell]) -> list[CellText]:
    """Return text, spread or interval, and marks of a column's cells."""
    lines = []
    for cell in cells:
        spread, mark = "", ""
        if isinstance(cell, Mean):
            mark = ("" if cell.complete else "*") + ("†" if cell.stalled else "")
            if (deviation := cell.spread_or_uncertainty) and abs(cell.value) >= column.rounding:
                spread = f"± {duration(deviation) if column.unit == 's' else number(deviation, 1)}"
        elif isinstance(cell, Effect):
            mark = ("" if cell.complete else "*") + _COVERED.get(cell.covers, "")
            ends = cell.interval or ()
            spread = " to ".join("∞" if end == math.inf else number(end, column.digits) for end in ends)
        lines.append({"text": _text(run, column, cell), "spread": spread, "mark": mark})
    return lines


def _text(run: Run, column: Column, cell: Cell) -> str:
    if isinstance(cell, Effect):
        sign = {RATIO: "×", DIFFERENCE: "+" if cell.value > 0.0 else ""}.get(cell.scale, "")
        return sign + number(cell.shown, column.digits)
    value = cell.value if isinstance(cell, Mean) else cell
    if isinstance(value, str):
        return (run.label(value) if column.method else value) or DASH
    if isinstance(value, int):
        return str(value)
    if value == math.inf:  # tolerances away from a number that must be exact
        return "∞"
    if column.unit == "s":
        return duration(value)
    if value is not None and abs(value) < column.rounding:
        return number(0.0)
    small = column.digits > 3 and value is not None and abs(value) < SMALL
    return number(value, 2 if small else column.digits, trim=column.trim)
