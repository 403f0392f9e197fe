"""Tables of a run, for CSV, PDF, page and LaTeX.

TABLES lists them in order; each entry makes its tables of a run. A new table of means is one Pivot here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from reports.run.finished_run import Run
from reports.tables.ablations import ablation_effects, ablations
from reports.tables.body_shapes import shapes
from reports.tables.dictionary import dictionary
from reports.tables.engines.audit import engine_audit, engine_laws
from reports.tables.fabric.textile_tests import (
    fabric_bands,
    fabric_drape,
    fabric_order,
)
from reports.tables.findings import (
    errors_in_spreads,
    findings,
    relative_excess,
    relative_excess_by_motion,
)
from reports.tables.latex import write_latex
from reports.tables.outcomes import endings, extremes, unfinished, validation
from reports.tables.page_one_table import overview
from reports.tables.paper_values import paper_table_1
from reports.tables.pivot import metric_tables
from reports.tables.speed import SPEED, crossings, error_rivals, reference_uncertainty
from reports.tables.table import Table
from reports.tables.trainings import training_curves, trainings

TABLES: tuple[Callable[[Run], list[Table]], ...] = (
    metric_tables,
    overview,
    paper_table_1,
    relative_excess,
    relative_excess_by_motion,
    errors_in_spreads,
    findings,
    ablations,
    ablation_effects,
    crossings,
    error_rivals,
    reference_uncertainty,
    SPEED,
    shapes,
    fabric_order,
    fabric_drape,
    fabric_bands,
    engine_audit,
    engine_laws,
    validation,
    extremes,
    endings,
    unfinished,
    trainings,
    training_curves,
)


def make_tables(run: Run) -> dict[str, Table]:
    """Make every table that the run has a number for: name -> table."""
    return {table.name: table for make in TABLES for table in make(run)}


def write_tables(folder: Path, run: Run, tables: Mapping[str, Table]) -> None:
    """Write CSV files, LaTeX and the dictionary of results.csv, in place of those of an earlier report."""
    for pattern in ("*.csv", "*.tex"):
        for path in folder.glob(pattern):
            path.unlink()
    for table in (*tables.values(), dictionary(run)):
        table.write_csv(folder)
    write_latex(run, tables, folder)
