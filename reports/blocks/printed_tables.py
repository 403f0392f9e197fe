"""Parts of tables that the PDF prints; the CSV and the page have all."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from reports.run.finished_run import Run
from reports.tables.findings import merged
from reports.tables.table import Cell, Table

LETTERS = 90  # of a sentence in a cell


def unchanged(run: Run, table: Table) -> Table:
    """Return the table as it is."""
    return table


def shortened(table: Table, most: int) -> Table:
    """Return the first rows of each group, equally many; a note says where the others are."""
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
    note = f"{len(table.rows) - most} more rows are in tables/{table.name}.csv. {table.note}".strip()
    return replace(table, rows=tuple(table.rows[line] for line in chosen), note=note)


def cut(text: str) -> str:
    """Return a text of at most LETTERS letters."""
    return text if len(text) <= LETTERS else f"{text[: LETTERS - 1].rstrip()}…"


def failed_checks(run: Run, table: Table) -> Table:
    """Return the checks that failed."""
    rows = tuple(row for row in table.rows if row[-1] not in ("pass", "reported"))
    return replace(table, rows=rows, caption="Checks that failed; all are in tables/validation.csv.")


def not_converged(run: Run, table: Table) -> Table:
    """Return the stress tests that did not converge."""
    rows = tuple((*row[:-1], cut(str(row[-1]))) for row in table.rows if row[2] != "converged")
    caption = "Stress tests that did not converge, and why; all are in tables/extremes.csv."
    return replace(table, rows=rows, caption=caption)


def with_labels(run: Run, table: Table) -> Table:
    """Return cells that did not end well, methods by their labels, lines with the same reason as one."""
    place = [column.name for column in table.columns].index("method")
    rows = []
    for row in table.rows:
        reason = str(row[-1]).removeprefix(f"{row[place]} ")
        rows.append((*row[:place], run.label(str(row[place])), *row[place + 1 : -1], reason))
    lines = merged(replace(table, rows=tuple(rows)), ("seed", "suite", "scene", "method"))
    return replace(lines, rows=tuple(tuple(cut(str(cell)) for cell in row) for row in lines.rows))
