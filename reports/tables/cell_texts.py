"""Texts of a table's cells, as PDF, page and LaTeX print them: number, ± or interval, marks, remarks."""

from __future__ import annotations

import math
from collections.abc import Sequence

from reports.run.finished_run import Run
from reports.statistics.effects import DIFFERENCE, RANGE, RATIO, Effect
from reports.statistics.means_and_spreads import Mean
from reports.tables.number_texts import DASH, aligned, duration, number
from reports.tables.table import Cell, Column, Table

CellText = dict[str, str]  # text, spread, mark
REMARKS = {
    "*": "* A mean over fewer scenes or seeds than in the other rows, for want of the rest.",
    "†": "† The solver left some frames unconverged.",
    "‡": "‡ The interval is over seeds alone: there is one motion, or motions make no difference.",
    "§": "§ The interval is over motions alone: there is no second seed, or seeds make no difference.",
    "#": "# The range over motions and seeds.",
}
_COVERED = {"seeds": "‡", "motions": "§", RANGE: "#"}
SMALL = 1e-3  # what is asked for in more digits and lies below it is an error: two digits say enough


def remarks_below(table: Table, lines: Sequence[Sequence[CellText]]) -> str:
    """Return the remarks below a table: its note, the meaning of its ± and of the marks in its lines."""
    remarks = [table.note] if table.note else []
    means = [cell for row in table.rows for cell in row if isinstance(cell, Mean)]
    kinds = []
    if any(mean.spread for mean in means):
        seeds = sorted({mean.seeds for mean in means if mean.spread is not None})
        kinds.append(f"standard deviation over {' or '.join(map(str, seeds))} seeds")
    if any(mean.uncertainty for mean in means):
        kinds.append("the spread of the reference's ensemble, or a sample's error")
    if kinds:
        lone = any(m.spread_or_uncertainty is None for m in means)
        without = " Without it: one seed, or nothing random." if lone and len(kinds) == 1 else ""
        remarks.append(f"±: {' or, where larger, '.join(kinds)}.{without}")
    marks = {mark for line in lines for cell in line for mark in cell["mark"]}
    return " ".join([*remarks, *(REMARKS[mark] for mark in sorted(marks))])


def column_texts(run: Run, column: Column, cells: Sequence[Cell], printed: Sequence[str]) -> list[CellText]:
    """Return text, spread or interval, and marks of a column's cells; `printed`: the paper's rows below."""
    texts = [*(_text(run, column, cell) for cell in cells), *printed]
    texts = texts if column.text or column.mixed else aligned(texts)
    lines = []
    for text, cell in zip(texts, [*cells, *[None] * len(printed)]):
        spread, mark = "", ""
        if isinstance(cell, Mean):
            mark = ("" if cell.complete else "*") + ("†" if cell.stalled else "")
            if (apart := cell.spread_or_uncertainty) and abs(cell.value) >= column.rounding:
                spread = f"± {duration(apart) if column.unit == 's' else number(apart, 1)}"
        elif isinstance(cell, Effect):
            mark = ("" if cell.complete else "*") + _COVERED.get(cell.covers, "")
            ends = cell.interval or ()
            spread = " to ".join("∞" if end == math.inf else number(end, column.digits) for end in ends)
        lines.append({"text": text, "spread": spread, "mark": mark})
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
