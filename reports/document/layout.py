"""Layout of report blocks: plain values for the template, every number a text, every dash in place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from reports.blocks.block import ROWS, Report, SentenceBlock, TableBlock
from reports.blocks.printed_tables import shortened
from reports.figures.figure import Figure, Picture
from reports.run.finished_run import Run
from reports.tables.cell_texts import CellText, column_texts, remarks_below
from reports.tables.number_texts import DASH
from reports.tables.table import Column, Table

Values = dict[str, Any]  # of one block, as JSON takes them
FEW = 5  # up to so many columns, the columns of a table share its width evenly
MOST = 9  # columns of numbers that fit on a page; a wider table goes on below


def lay_out(report: Report, block: SentenceBlock | Figure | TableBlock) -> list[Values]:
    """Return the values of a block, none where the report has no content for it."""
    if isinstance(block, SentenceBlock):
        sentences = [list(pair) for pair in block.make(report.run)]
        return [{"kind": "sentences", "pairs": sentences, "small": block.small}] if sentences else []
    if isinstance(block, Figure):
        return [_figure(picture) for picture in report.pictures.get(block.name, ())]
    if block.name not in report.tables:
        return []
    table = block.printed(report.run, report.tables[block.name])
    return list(lay_out_table(report.run, shortened(table, block.most))) if table.rows else []


def _figure(picture: Picture) -> Values:
    return {
        "kind": "figure",
        "path": f"figures/{picture.path.name}",
        "caption": picture.caption,
        "width": picture.width,
    }


def lay_out_table(run: Run, table: Table) -> Iterator[Values]:
    """Yield a table, in parts where it has more columns than fit on a page."""
    heads = [column for column in table.columns if column.text]
    numbers = [column for column in table.columns if not column.text]
    parts = max(1, -(-len(numbers) // MOST))
    each = max(1, -(-len(numbers) // parts))
    for first in range(0, max(len(numbers), 1), each):
        shown = {column.name for column in (*heads, *numbers[first : first + each])}
        places = [place for place, column in enumerate(table.columns) if column.name in shown]
        rows = [tuple(row[place] for place in places) for row in table.rows]
        columns = tuple(table.columns[place] for place in places)
        rows = [row for row in rows if first == 0 or any(cell is not None for cell in row[len(heads) :])]
        caption = table.caption + (" (continued)" if first else "")
        yield _part(run, replace(table, columns=columns, rows=tuple(rows), caption=caption))


def _part(run: Run, table: Table) -> Values:
    heads = [place for place, column in enumerate(table.columns) if column.name in table.grouped_by]
    places = [place for place in range(len(table.columns)) if place not in heads]
    columns = [table.columns[place] for place in places]
    references = [r for r in table.references if any(column.name in r[1] for column in columns)]
    cells = []
    for rank, (place, column) in enumerate(zip(places, columns)):
        printed = [label if rank == 0 else texts.get(column.name, DASH) for label, texts in references]
        cells.append(column_texts(run, column, [row[place] for row in table.rows], printed))
    lines = [list(line) for line in zip(*cells)]
    groups: dict[str, list[list[CellText]]] = {}
    for row, line in zip(table.rows, lines):
        groups.setdefault(" · ".join(str(row[place]) for place in heads), []).append(line)
    return {
        "kind": "table",
        "caption": table.caption,
        "note": remarks_below(table, lines),
        "columns": [
            {"title": column.title, "unit": column.unit_above, "left": column.text, "width": width}
            for column, width in zip(columns, _widths(columns))
        ],
        "groups": [{"title": title, "rows": rows} for title, rows in groups.items()],
        "references": lines[len(table.rows) :],
        "breakable": len(table.rows) > ROWS,
    }


def _widths(columns: Sequence[Column]) -> list[str]:
    """Return widths: columns of numbers share evenly; with texts among them each takes what it needs."""
    if all(not column.text for column in columns[1:]):
        return ["1.4fr" if len(columns) <= FEW else "2.4fr", *["1fr"] * (len(columns) - 1)]
    return ["auto"] * len(columns)
