"""Tables of a run, for CSV, PDF and page.

TABLES lists them in order; each entry makes its tables of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from reports.finished_run import Run
from reports.tables.findings import (
    errors_in_spreads,
    extremes,
    findings,
    list_unfinished,
    relative_excess,
    validation,
)
from reports.tables.page_one import overview
from reports.tables.paper_tables import paper_tables
from reports.tables.pivots import ablation_effects, metric_tables, shapes
from reports.tables.table import Table

TABLES: tuple[Callable[[Run], list[Table]], ...] = (
    metric_tables,
    overview,
    paper_tables,
    relative_excess,
    errors_in_spreads,
    findings,
    ablation_effects,
    shapes,
    validation,
    extremes,
    list_unfinished,
)


def make_tables(run: Run) -> dict[str, Table]:
    """Make every table that the run has a number for: name -> table."""
    return {table.name: table for make in TABLES for table in make(run)}


def write_tables(folder: Path, tables: Iterable[Table]) -> None:
    """Write a CSV file of each table, in place of those of an earlier report."""
    for path in folder.glob("*.csv"):
        path.unlink()
    for table in tables:
        table.write_csv(folder)
