"""Files of tables: a CSV of each, LaTeX of the paper's, and the dictionary of results.csv."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from reports.run.finished_run import Run
from reports.tables.dictionary import dictionary
from reports.tables.latex import write_latex
from reports.tables.table import Table


def write_tables(folder: Path, run: Run, tables: Mapping[str, Table]) -> None:
    """Write the tables into the folder, in place of all tables of an earlier report."""
    for pattern in ("*.csv", "*.tex"):
        for path in folder.glob(pattern):
            path.unlink()
    for table in (*tables.values(), dictionary(run)):
        table.write_csv(folder)
    write_latex(run, tables, folder)
