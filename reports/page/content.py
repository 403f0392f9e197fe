"""What the page shows besides roll-outs: its head, its plots and its tables, as plain values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from reports.document.layout import column_texts, remarks_of
from reports.figures.styles import style
from reports.figures.work_precision import error_points
from reports.run.rows import Run
from reports.statistics.means import Mean, value_of
from reports.statistics.pareto import ERRORS, WHOLE, indistinct, run_time
from reports.statistics.significance import Effect
from reports.tables.table import Cell, Column, Table
from reports.tables.tables import merged

NOT_SHOWN = "metrics"  # the file to plot from: everything that the other tables hold, line by line
MEANING = {"stalled": "with frames left unconverged"}
WRONG = ("failed", "timeout", "out-of-memory", "diverged")


def methods_of(run: Run) -> dict[str, dict[str, Any]]:
    """Method -> label, role, colour, and the family of those that differ by one number."""
    return {
        name: {
            "label": method.label, "role": method.role, "colour": style(run, name).colour,
            "family": method.family if method.level is not None else "", "level": method.level,
        }
        for name, method in run.methods.items()
    }  # fmt: skip


def plots_of(run: Run) -> dict[str, dict[str, Any]]:
    """Scene -> the points of its plots of error against run time; scenes with two points or more."""
    cells = run.cells("speed", "garments")
    found = {}
    for scene, rows in cells.groupby("scene", sort=False):
        panels = {name: panel for name in ERRORS if (panel := _panel(run, rows, name))}
        if panels:
            time = run_time(rows)
            words = "pose to vertices" if time == WHOLE else "own work"
            found[str(scene)] = {
                "time": f"run time, {words} [ms per frame]",
                "reference": value_of(rows, run.reference, time),
                "panels": panels,
            }
    return found


def _panel(run: Run, rows: pd.DataFrame, metric: str) -> dict[str, Any] | None:
    points = [] if metric not in run.metrics else error_points(run, rows, metric)
    if len(points) < 2:
        return None
    return {
        "title": run.metrics[metric].heading, "definition": run.metrics[metric].definition,
        "band": indistinct(run, rows, metric),
        "points": [[p.method, p.time, p.error, p.time_spread, p.error_spread] for p in points],
    }  # fmt: skip


def tables_of(run: Run, tables: Iterable[Table]) -> list[dict[str, Any]]:
    """Every table that has a caption or columns of its own, its cells as texts with what they sort by."""
    return [_table(run, table) for table in tables if table.name != NOT_SHOWN]


def _table(run: Run, table: Table) -> dict[str, Any]:
    printed = [_printed(table, reference) for reference in table.references]
    texts = [
        column_texts(run, column, [row[place] for row in table.rows], [row[place] for row in printed])
        for place, column in enumerate(table.columns)
    ]
    lines = [list(line) for line in zip(*texts)]
    rows = [[_cell(text, cell) for text, cell in zip(line, row)] for line, row in zip(lines, table.rows)]
    return {
        "name": table.name, "caption": table.caption or table.name, "note": remarks_of(table, lines),
        "columns": [_column(run, column) for column in table.columns], "rows": rows,
        "printed": [[text["text"] for text in line] for line in lines[len(rows) :]],
    }  # fmt: skip


def _printed(table: Table, reference: tuple[str, dict[str, str]]) -> list[str]:
    """A row of others: its label stands in the last column of words."""
    label, own = reference
    words = [column.name for column in table.columns if column.text]
    return [label if column.name == words[-1] else own.get(column.name, "") for column in table.columns]


def _column(run: Run, column: Column) -> dict[str, Any]:
    metric = run.metrics.get(column.name)
    said = metric.definition if metric else ""
    better = metric.lower_is_better if metric else None
    if better is not None:
        said += f"; {'lower' if better else 'higher'} is better"
    return {"title": column.title, "unit": column.unit, "words": column.text, "definition": said}


def _cell(text: dict[str, str], cell: Cell) -> str | list[Any]:
    """A text that sorts by itself; or a number as [text, value, spread, mark]."""
    value = cell.value if isinstance(cell, Mean | Effect) else cell
    if isinstance(value, str):
        return text["text"]
    number = None if value is None or math.isnan(value) else max(min(float(value), 1e300), -1e300)
    return [text["text"], number, text["spread"], text["mark"]]


def trouble_of(run: Run, tables: Mapping[str, Table]) -> tuple[str, bool, list[str]]:
    """What did not run to its end: a sentence of counts, whether anything went wrong, and each in words."""
    if "unfinished" not in tables:
        return "", False, []
    names = [column.name for column in tables["unfinished"].columns]
    rows = [dict(zip(names, row)) for row in tables["unfinished"].rows]
    cells: dict[tuple, str] = {}
    for row in rows:
        cells.setdefault((row["suite"], row["scene"], row["method"], row["seed"]), str(row["status"]))
    counts = pd.Series(list(cells.values())).value_counts()
    order = [*(status for status in WRONG if status in counts), *(s for s in counts.index if s not in WRONG)]
    text = ", ".join(f"{counts[status]} {MEANING.get(status, status)}" for status in order)
    lines = []
    ended = (dict(zip(names, line)) for line in merged(tables["unfinished"], ("suite", "scene")).rows)
    for own in sorted(ended, key=lambda own: order.index(own["status"])):
        label = run.label(str(own["method"]))
        lines.append(f"{own['status']}: {label}, seed {own['seed']}, {own['scene']}: {own['reason']}")
    return f"Not every cell ended well: {text}.", any(status in counts for status in WRONG), lines
