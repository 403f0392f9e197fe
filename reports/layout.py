"""Tables and figures as the template takes them: every number already a text, every dash in place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from reports import palette
from reports.canvas import Picture
from reports.numbers import DASH, aligned, duration, number
from reports.summary import Mean
from reports.table import Cell, Table

Block = dict[str, Any]
LONG = 24  # rows from which a table may run over pages

# Texts that need room get a share of the page's width; every other column is as wide as its content.
WIDTHS = {
    "reason": "2fr", "check": "1fr", "recipe": "1fr", "finding": "2fr", "case": "1fr", "scene": "1fr",
    "worse": "1fr", "better": "1fr", "beaten": "1fr", "solver": "1.3fr", "hybrid": "1.3fr",
}  # fmt: skip
FEW = 5  # up to so many columns, the columns of a table share its width evenly
TEXTS = (
    "method", "finding", "recipe", "scene", "suite", "check", "case", "outcome", "status", "reason", "unit",
    "worse", "better", "bound", "measure", "beaten", "solver", "hybrid",
)  # fmt: skip
COSTS = ("data_generation", "training", "run_time", "memory")
REMARKS = {
    "*": "* A mean over fewer scenes than in the other rows, for want of the rest.",
    "†": "† The solver left some frames unconverged.",
}
_WORDS: dict[str, Callable[[str], str]] = {
    "method": palette.label,
    "outcome": lambda text: "converged" if text == "ok" else text,
    "status": lambda text: "pass" if text == "ok" else text,
}
_DIGITS = {
    "measured": 7, "expected": 7, "tolerance": 2, "gradient": 2, "apart": 2, "scatter": 2, "gain": 2,
    "crossing": 2,
}  # fmt: skip
_NOISE = 1e-3  # what is measured below it is an error, of which two digits say enough
_ZERO = {"lag": 5e-3}  # lags are looked for in hundredths of a frame: less is none
_TIMES = ("data_generation", "training", "total_time")


def table_block(
    table: Table,
    caption: str,
    *,
    references: Sequence[tuple[str, Sequence[str]]] = (),
    note: str = "",
    grouped_by: Sequence[str] = (),
) -> Block:
    """A table for the page.

    `references` are rows of others' numbers as they print them, set apart below and never mixed in.
    Columns in `grouped_by` become headings over the rows that share their values.
    """
    places = [place for place, column in enumerate(table.columns) if column.name not in grouped_by]
    columns = [table.columns[place] for place in places]
    lines = [[row[place] for place in places] for row in table.rows]
    texts = [
        _column_texts(column.name, [line[place] for line in lines], [r[1][place - 1] for r in references])
        if place
        else _column_texts(column.name, [line[0] for line in lines], [r[0] for r in references])
        for place, column in enumerate(columns)
    ]
    cells = [list(line) for line in zip(*texts)]
    groups: dict[str, list[list[dict[str, str]]]] = {}
    heads = [place for place, column in enumerate(table.columns) if column.name in grouped_by]
    for row, line in zip(table.rows, cells):
        groups.setdefault(" · ".join(str(row[place]) for place in heads), []).append(line)
    remarks = [note]
    if any(cell["spread"] for line in cells for cell in line):
        means = [cell for row in table.rows for cell in row if isinstance(cell, Mean)]
        seeds = sorted({mean.seeds for mean in means if mean.spread is not None})
        number_of = " or ".join(str(count) for count in seeds)
        lone = " Without it: one seed, or nothing random." if any(m.spread is None for m in means) else ""
        remarks.append(f"±: standard deviation over {number_of} seeds.{lone}")
    marks = {mark for line in cells for cell in line for mark in cell["mark"]}
    remarks += [REMARKS[mark] for mark in sorted(marks)]
    return {
        "kind": "table",
        "caption": caption,
        "note": " ".join(remark for remark in remarks if remark),
        "columns": [
            {
                "title": column.title,
                "unit": column.unit,
                "left": column.name in TEXTS,
                "width": width,
            }
            for column, width in zip(columns, _widths([column.name for column in columns]))
        ],
        "groups": [{"title": title, "rows": rows} for title, rows in groups.items()],
        "references": cells[len(table.rows) :],
        "breakable": len(table.rows) > LONG,
    }


def _widths(names: Sequence[str]) -> list[str]:
    if any(name in WIDTHS for name in names):
        return [WIDTHS.get(name, "auto") for name in names]
    rest = "1fr" if len(names) <= FEW else "auto"
    return ["1.4fr" if len(names) <= FEW else "1fr", *[rest] * (len(names) - 1)]


def _column_texts(name: str, cells: Sequence[Cell], references: Sequence[str]) -> list[dict[str, str]]:
    """Text, spread over seeds and mark of an incomplete mean, for each cell of a column."""
    texts = [*(_text(name, cell) for cell in cells), *references]
    texts = texts if name in TEXTS else aligned(texts)
    found = []
    for text, cell in zip(texts, [*cells, *[None] * len(references)]):
        mean = cell if isinstance(cell, Mean) else None
        spread = _spread(name, mean.spread) if mean and mean.spread else ""
        # A cost is measured where it arises: a training has no scene, so none is missing from its mean.
        mark = "*" if mean and not mean.complete and name not in COSTS else ""
        mark += "†" if mean and mean.stalled else ""
        found.append({"text": text, "spread": spread, "mark": mark})
    return found


def _spread(name: str, spread: float) -> str:
    return f"± {duration(spread) if name in _TIMES else number(spread, 1)}"


def _text(name: str, cell: Cell) -> str:
    value = cell.value if isinstance(cell, Mean) else cell
    if isinstance(value, float) and abs(value) < _ZERO.get(name, 0.0):
        value = 0.0
    if isinstance(value, str):
        return _WORDS.get(name, str)(value) or DASH
    if name in _TIMES:
        return duration(value)
    if isinstance(value, int):
        return str(value)
    if name not in _DIGITS:
        return number(value)
    small = name == "measured" and value is not None and abs(value) < _NOISE
    return number(value, 2 if small else _DIGITS[name], trim=True)


def figure_block(picture: Picture) -> Block:
    """A figure for the page."""
    return {
        "kind": "figure",
        "path": f"figures/{picture.path.name}",
        "caption": picture.caption,
        "width": picture.width,
    }


def list_block(intro: str, items: Sequence[str]) -> Block:
    """A sentence and a list under it."""
    return {"kind": "list", "intro": intro, "items": list(items)}
