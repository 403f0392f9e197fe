"""Tables and figures as the template takes them: every number already a text, every dash in place."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from reports.figures.plotting import Picture
from reports.run.rows import Run
from reports.statistics.means import Mean
from reports.statistics.significance import Effect
from reports.tables.numbers import DASH, aligned, duration, number
from reports.tables.table import Cell, Column, Table

Block = dict[str, Any]
LONG = 5  # rows from which a table may run over pages
FEW = 5  # up to so many columns, the columns of a table share its width evenly
MOST = 9  # columns of numbers that fit on a page; a wider table goes on below
REMARKS = {
    "*": "* A mean over fewer scenes or seeds than in the other rows, for want of the rest.",
    "†": "† The solver left some frames unconverged.",
    "‡": "‡ The interval is over seeds alone: there is one motion, or motions make no difference.",
    "§": "§ The interval is over motions alone: there is no second seed, or seeds make no difference.",
}
NOISE = 1e-3  # what is asked for in more digits and lies below it is an error: two digits say enough


def table_blocks(run: Run, table: Table) -> Iterator[Block]:
    """A table for the page, in parts where it has more columns than fit."""
    texts = [column for column in table.columns if column.text]
    numbers = [column for column in table.columns if not column.text]
    parts = max(1, -(-len(numbers) // MOST))
    each = max(1, -(-len(numbers) // parts))
    for first in range(0, max(len(numbers), 1), each):
        shown = {column.name for column in (*texts, *numbers[first : first + each])}
        places = [place for place, column in enumerate(table.columns) if column.name in shown]
        rows = [tuple(row[place] for place in places) for row in table.rows]
        columns = tuple(table.columns[place] for place in places)
        heads = len(texts)
        rows = [row for row in rows if first == 0 or any(cell is not None for cell in row[heads:])]
        caption = table.caption + (" (continued)" if first else "")
        yield _block(run, replace(table, columns=columns, rows=tuple(rows), caption=caption))


def shortened(table: Table, most: int) -> Table:
    """The first rows of each of its groups, equally many, and in its note where the others are."""
    if len(table.rows) <= most:
        return table
    heads = [place for place, column in enumerate(table.columns) if column.name in table.grouped_by]
    groups = [tuple(row[place] for place in heads) for row in table.rows]
    before: Counter[tuple[Cell, ...]] = Counter()
    order = []
    for line, group in enumerate(groups):
        order.append((before[group], line))
        before[group] += 1
    chosen = sorted(line for _, line in sorted(order)[:most])
    left = f"{len(table.rows) - most} more rows are in tables/{table.name}.csv."
    rows = tuple(table.rows[line] for line in chosen)
    return replace(table, rows=rows, note=f"{left} {table.note}".strip())


def _block(run: Run, table: Table) -> Block:
    heads = [place for place, column in enumerate(table.columns) if column.name in table.grouped_by]
    places = [place for place in range(len(table.columns)) if place not in heads]
    columns = [table.columns[place] for place in places]
    references = [r for r in table.references if any(column.name in r[1] for column in columns)]
    cells = []
    for number_, (place, column) in enumerate(zip(places, columns)):
        printed = [label if number_ == 0 else own.get(column.name, DASH) for label, own in references]
        cells.append(column_texts(run, column, [row[place] for row in table.rows], printed))
    lines = [list(line) for line in zip(*cells)]
    groups: dict[str, list[list[dict[str, str]]]] = {}
    for row, line in zip(table.rows, lines):
        groups.setdefault(" · ".join(str(row[place]) for place in heads), []).append(line)
    return {
        "kind": "table",
        "caption": table.caption,
        "note": remarks_of(table, lines),
        "columns": [
            {"title": column.title, "unit": column.unit_above, "left": column.text, "width": width}
            for column, width in zip(columns, _widths(columns))
        ],
        "groups": [{"title": title, "rows": rows} for title, rows in groups.items()],
        "references": lines[len(table.rows) :],
        "breakable": len(table.rows) > LONG,
    }


def remarks_of(table: Table, lines: Sequence[Sequence[dict[str, str]]]) -> str:
    """What the table says of itself, of its spreads and of the marks in it."""
    remarks = [table.note] if table.note else []
    means = [cell for row in table.rows for cell in row if isinstance(cell, Mean)]
    words = []
    if any(mean.spread for mean in means):
        seeds = sorted({mean.seeds for mean in means if mean.spread is not None})
        words.append(f"standard deviation over {' or '.join(map(str, seeds))} seeds")
    if any(mean.uncertainty for mean in means):
        words.append("what another simulation as right as the reference changes, or a sample's error")
    if words:
        lone = any(m.spread_or_uncertainty is None for m in means)
        without = " Without it: one seed, or nothing random." if lone and len(words) == 1 else ""
        remarks.append(f"±: {' or, where larger, '.join(words)}.{without}")
    marks = {mark for line in lines for cell in line for mark in cell["mark"]}
    return " ".join([*remarks, *(REMARKS[mark] for mark in sorted(marks))])


def _widths(columns: Sequence[Column]) -> list[str]:
    """Columns of numbers share the width evenly; where words stand among them each takes what it needs."""
    if all(not column.text for column in columns[1:]):
        return ["1.4fr" if len(columns) <= FEW else "2.4fr", *["1fr"] * (len(columns) - 1)]
    return ["auto"] * len(columns)


def column_texts(
    run: Run, column: Column, cells: Sequence[Cell], printed: Sequence[str]
) -> list[dict[str, str]]:
    """Text, spread or interval, and marks for each cell of a column; `printed` are rows of others below."""
    texts = [*(_text(run, column, cell) for cell in cells), *printed]
    texts = texts if column.text or column.mixed else aligned(texts)
    found = []
    for text, cell in zip(texts, [*cells, *[None] * len(printed)]):
        spread, mark = "", ""
        if isinstance(cell, Mean):
            mark = ("" if cell.complete else "*") + ("†" if cell.stalled else "")
            if apart := cell.spread_or_uncertainty:
                spread = f"± {duration(apart) if column.unit == 's' else number(apart, 1)}"
        elif isinstance(cell, Effect):
            mark = ("" if cell.complete else "*") + {"seeds": "‡", "motions": "§"}.get(cell.covers, "")
            spread = " to ".join("∞" if end == math.inf else number(end) for end in cell.interval or ())
        found.append({"text": text, "spread": spread, "mark": mark})
    return found


def _text(run: Run, column: Column, cell: Cell) -> str:
    if isinstance(cell, Effect):
        sign = "×" if cell.ratio else "+" if cell.value > 0.0 else ""
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
    small = column.digits > 3 and value is not None and abs(value) < NOISE
    return number(value, 2 if small else column.digits, trim=column.trim)


def figure_block(picture: Picture) -> Block:
    """A figure for the page."""
    return {
        "kind": "figure",
        "path": f"figures/{picture.path.name}",
        "caption": picture.caption,
        "width": picture.width,
    }


def row_block(pictures: Sequence[Picture]) -> Block:
    """Figures side by side; one alone keeps its width."""
    items = [figure_block(picture) for picture in pictures]
    return {"kind": "row", "items": items} if len(items) > 1 else items[0]


def list_block(intro: str, items: Sequence[str]) -> Block:
    """A sentence and a list under it."""
    return {"kind": "list", "intro": intro, "items": list(items)}


def pairs_block(pairs: Sequence[tuple[str, str]]) -> Block:
    """Names and what is said of each."""
    return {"kind": "pairs", "pairs": [list(pair) for pair in pairs]}
