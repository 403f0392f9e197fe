"""A table as plain text: for the terminal, and for Markdown with one number a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from reports.finished_run import Run
from reports.sentences import TRAINED, headline
from reports.statistics.effects import Effect
from reports.tables.table import DASH, REMARKS, Table, column_texts

MARKS = "*†"  # of numbers that lack something


def text_rows(run: Run, table: Table, columns: Sequence[str] = ()) -> list[list[str]]:
    """Return headings and cells of a table, all of it as text.

    Args:
        run: has the labels of methods.
        table: the table.
        columns: names of those wanted, in this order; all by default.

    An effect takes two columns: its value, and its interval. A mean stands without its spread. Columns in
    which nothing stands are left out.

    Raises:
        KeyError: for a column that the table has not.
    """
    places = {column.name: k for k, column in enumerate(table.columns)}
    texts: list[list[str]] = []
    for place in (places[name] for name in columns or places):
        column, cells = table.columns[place], [row[place] for row in table.rows]
        printed = column_texts(run, column, cells)
        heading = f"{column.title} [{column.unit_above}]" if column.unit_above else column.title
        # What an interval covers is not marked, it has a column.
        marks = ["".join(m for m in cell["mark"] if m in MARKS) for cell in printed]
        texts.append([heading, *(c["text"].strip() + m for c, m in zip(printed, marks))])
        if any(isinstance(cell, Effect) and cell.interval for cell in cells):
            texts.append(["Interval", *(cell["spread"] or DASH for cell in printed)])
    return [list(line) for line in zip(*(column for column in texts if set(column[1:]) - {DASH}))]


def remarks_on(rows: Sequence[Sequence[str]]) -> str:
    """Return what the marks in these rows mean, empty where there are none."""
    ends = [cell[len(cell.rstrip(MARKS)) :] for row in rows[1:] for cell in row]
    marks = sorted({*"".join(ends)})
    return " ".join(REMARKS[mark] for mark in marks)


def markdown_table(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as a table of Markdown, the first row its head.

    >>> print(markdown_table([["method", "total [J]"], ["snug", "0.34"]]))
    | method | total [J] |
    | --- | --- |
    | snug | 0.34 |
    """
    escaped = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    lines = [escaped[0], ["---"] * len(escaped[0]), *escaped[1:]]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


COLUMNS = (
    "method", "relative_excess", "dynamics/correlation", "penetration/surface", "cost/whole", "cost/frame",
    "gap/energy",
)  # fmt: skip
MOST_COLUMNS = 5  # of COLUMNS, without the intervals of effects


def answer(run: Run, tables: Mapping[str, Table]) -> str:
    """Return table and chief sentences of page one, empty where the run has neither."""
    lines, notes = [], []
    if "overview" in tables:
        table = tables["overview"]
        names = [column.name for column in table.columns]
        rows = text_rows(run, table, [name for name in COLUMNS if name in names][:MOST_COLUMNS])
        lines.append(markdown_table(rows))
        notes = [remarks_on(rows)]
    chief = [text for topic, text in headline(run) if topic in ("Verdict", TRAINED)]
    lines.append(" ".join(filter(None, [*chief, *notes])))
    return "\n".join(filter(None, lines)).replace("\u00a0", " ")
