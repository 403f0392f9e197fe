"""Page of entries: tables that sort, in one file that asks for no other."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.entries.tables import Scored, entries_tables, of_entry
from reports.page.page_data import table_data
from reports.page.write_page import filled
from reports.run.finished_run import Run
from reports.run.reading import read_run
from reports.tables.table import Table

ENTRIES = "submissions"
PAGE = "index.html"
SCRIPTS = ("tables", "entries")  # in this order


def entries_page(path: Path, tables: Sequence[tuple[Table, Sequence[Scored]]]) -> str:
    """Return the markup of the page.

    Args:
        path: where it will be; links lead from it to pages of runs.
        tables: of reports.entries.tables.entries_tables.
    """
    content = []
    for table, scored in tables:
        data = table_data(scored[0].run, table)
        for row, entry in zip(data["rows"], scored):
            if link := entry.link(path):
                row[0] = [row[0], row[0], "", "", link]
        content.append(data)
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    # No text of an entry ends the element.
    return filled("entries.html", SCRIPTS, content=text.replace("<", "\\u003c"))


def entries_in(folder: Path) -> list[Path]:
    """Return the folders of entries, by name. Raises ResultsError where there is none."""
    entries = sorted(path.parent for path in folder.glob("*/entry.toml"))
    if not entries:
        raise ResultsError(f"{folder}: holds no entry, a folder with entry.toml")
    return entries


def page_of(folder: Path, path: Path, published: tuple[RunFolder, Run]) -> tuple[str, list[Path]]:
    """Return the page of the entries in a folder, and the entries that have no scores.

    Args:
        folder: has a folder for each entry.
        path: where the page will be.
        published: the run whose methods stand beside entries of its protocol.

    Raises:
        ResultsError: no entry, or scores that cannot be read.
    """
    entries = entries_in(folder)
    scores = {entry: RunFolder(entry / "scores") for entry in entries}
    without = [entry for entry in entries if not scores[entry].config_path.is_file()]
    scored = [of_entry(scores[entry], read_run(scores[entry])) for entry in entries if entry not in without]
    return entries_page(path, entries_tables(scored, published)), without
