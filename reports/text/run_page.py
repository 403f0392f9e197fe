"""A page of the site for a published run: where it comes from, its headline, its tables with their files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from benchmarks.results.run_folder import RunFolder
from reports.blocks.sentences import headline
from reports.run.reading import read_run_with_trainings
from reports.tables import make_tables
from reports.tables.table import Table
from reports.text.text_table import markdown_table, remarks_on, text_rows

MOST_LINES = 60  # of a table that is printed; longer ones are files alone
ORIGIN = ("Day", "Commit", "Processor", "Cores")  # heads


def write_run_pages(published: Path, target: Path) -> list[Path]:
    """Write a page for each run in the folder `published` into `target`; return their paths.

    Links lead from `target` to the files of the runs, so both must lie in one tree.
    """
    target.mkdir(parents=True, exist_ok=True)
    pages = []
    for folder in sorted(path.parent for path in published.glob("*/run.json")):
        page = target / f"{folder.name}.md"
        page.write_text(run_page(folder, _link(target, folder)), encoding="utf-8", newline="\n")
        pages.append(page)
    return pages


def run_page(folder: Path, link: str) -> str:
    """Return the Markdown of a run's page.

    Args:
        folder: the published run.
        link: path that leads from the page to that folder.

    Raises:
        ResultsError: for a damaged folder.
    """
    stored = RunFolder(folder)
    config = stored.read_config()
    run = read_run_with_trainings(stored)
    parts = [f"# Run {folder.name}", _origin(config), _files(folder, link)]
    if sentences := headline(run):
        parts.append("\n".join(f"- {topic}: {sentence}" for topic, sentence in sentences))
    for name, table in make_tables(run).items():
        if table.rows and len(table.rows) <= MOST_LINES:
            rows = text_rows(run, table)
            parts += [f"## {name.replace('_', ' ').capitalize()}", _caption(table, folder, link)]
            parts += [markdown_table(rows), remarks_on(rows)]
    return "\n\n".join(filter(None, parts)) + "\n"


def origins(config: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return day, commit, processor, cores and command of a run, of each part of a merged one."""
    return [
        (
            str(part.get("finished", ""))[:10], part["commit"], part["hardware"]["processor"],
            str(part["hardware"]["cores"]), part["command"],
        )
        for part in config.get("merged", [config])
    ]  # fmt: skip


def _origin(config: dict[str, Any]) -> str:
    parts = origins(config)
    commands = "\n".join(command for *_, command in parts)
    return f"{markdown_table([ORIGIN, *(row for *row, _ in parts)])}\n\n```\n{commands}\n```"


def _files(folder: Path, link: str) -> str:
    """Return links to the report and to the numbers, as far as the run has them."""
    names = {"report.pdf": "Report", "results.csv": "Numbers", "run.json": "Configuration"}
    stored = {name: title for name, title in names.items() if (folder / name).is_file()}
    return ", ".join(f"[{title}]({link}/{name})" for name, title in stored.items())


def _caption(table: Table, folder: Path, link: str) -> str:
    """Return the caption of a table, with links to its files."""
    names = [f"{table.name}.{ending}" for ending in ("csv", "tex")]
    files = [name for name in names if (folder / "tables" / name).is_file()]
    return " ".join([table.caption, *(f"[{name}]({link}/tables/{name})" for name in files)])


def _link(target: Path, folder: Path) -> str:
    return Path(os.path.relpath(folder, target)).as_posix()
