"""Generated parts of a document: sentences of page one, a table of a run, the claims of the paper.

`front of RUN` (the answer of README), `table NAME of RUN; COLUMN, ...; METHOD, ...` (all where none is named;
of table `overview`, METHODs of several runs), `claims primary of RUN, ...`, `claims exploratory of RUN, ...`,
`counts of RUN, ...`, `runs of RUN, ...`; RUN is a folder of reports/published, and the first run that has
both methods of a claim judges it. `attributes of MODULE.CLASS`, `docstring of MODULE` (its table),
`recipes of NAME, ...`, `sources of the library` and the parts that `code_parts.PARTS` names come from the
code, `evaluations of published runs` from the run.json of each run; `attributes` and `options of
benchmarks.run` take names after a semicolon, whose rows alone are shown, in that order.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from io import StringIO
from itertools import chain
from pathlib import Path

from benchmarks.results.run_folder import RunFolder
from reports.statistics.published import PUBLISHED, read_published
from reports.tables import TABLES
from reports.tables.page_one_table import overview
from reports.tables.pivot import metric_tables
from reports.tables.table import Table
from reports.text.claim_rows import JudgedClaims, claim_counts, claim_rows, judge_in_first
from reports.text.code_parts import PARTS, attribute_rows, chosen_rows, docstring_rows, recipe_rows
from reports.text.front_sentences import front_sentences
from reports.text.run_page import origins
from reports.text.text_table import markdown_table, remarks_on, text_rows
from snug.motion.library import clip_rows, distance_rows, source_rows

FORMS = (
    "front of RUN; table NAME of RUN; COLUMN, ...; METHOD, ...; claims primary of RUN, ...; claims "
    "exploratory of RUN, ...; counts of RUN, ...; runs of RUN, ...; attributes of MODULE.CLASS; NAME, ...; "
    "docstring of MODULE; recipes of NAME, ...; sources of the library; evaluations of published runs; "
    f"{'; '.join(PARTS)}"
)

LIBRARY_FILES = {"library_clips.csv": clip_rows, "library_distances.csv": distance_rows}  # in docs/
TIMED = ("quick",)  # runs with nothing beside them, which judge claims on times
ORIGIN = ("Run", "Day", "Commit", "Processor")  # heads


def published_part(request: str) -> str:
    """Return the Markdown of a generated part. Raises ValueError for words of no known form."""
    what, _, source = request.partition(" of ")
    runs, *lists = source.split(";")
    wanted, methods = (
        [word.strip() for word in text.split(",") if word.strip()] for text in (*lists, "", "")[:2]
    )
    folders = [PUBLISHED / name.strip() for name in runs.split(",")]
    kind, _, name = what.partition(" ")
    if (part := request.partition(";")[0]) in PARTS:
        return markdown_table(chosen_rows(PARTS[part](), wanted))
    if kind == "docstring":
        return markdown_table(docstring_rows(source))
    if kind == "recipes":
        return markdown_table(recipe_rows(source))
    if kind == "attributes":
        return markdown_table(chosen_rows(attribute_rows(runs), wanted))
    if request == "sources of the library":
        return markdown_table(list(source_rows()))
    if request == "evaluations of published runs":
        return markdown_table(evaluation_rows(PUBLISHED))
    if kind == "front":
        return front_sentences(read_published(folders[0]))
    if what == "table overview" and methods:
        return _overview(folders, wanted, methods)
    if kind == "table":
        table = _of_methods(_table(folders[0], name), methods)
        rows = text_rows(read_published(folders[0]), table, wanted)
        return f"{markdown_table(rows)}\n\n{' '.join(filter(None, [table.caption, remarks_on(rows)]))}"
    if kind == "claims":
        return markdown_table(claim_rows(_claims(*folders), primary=name == "primary"))
    if kind == "counts":
        return claim_counts(_claims(*folders))
    if kind == "runs":
        parts = [(folder, part) for folder in folders for part in origins(RunFolder(folder).read_config())]
        lines = dict.fromkeys((folder.name, *part[:3]) for folder, part in parts)
        return markdown_table([ORIGIN, *lines])
    raise ValueError(f"no part is generated from '{request}'; known: {FORMS}")


def library_file(name: str) -> str:
    """Return the text of a CSV file of LIBRARY_FILES."""
    text = StringIO()
    rows = ([cell.strip("`") for cell in row] for row in LIBRARY_FILES[name]())
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def evaluation_rows(published: Path) -> list[tuple[str, ...]]:
    """Return a heading and rows of the runs in a folder: how often each evaluated test motions.

    Runs of one protocol and split with the same number of test-set evaluations share a row.
    """
    runs: dict[tuple[str, str, str], list[str]] = {}
    for path in sorted(published.glob("*/run.json")):
        config = RunFolder(path.parent).read_config()
        group = config["protocol"]["number"], str(config["split"]), str(len(config["test_looks"]))
        runs.setdefault(group, []).append(f"`{path.parent.name}`")
    lines = [(*group, ", ".join(runs[group])) for group in sorted(runs)]
    return [("Protocol", "Split", "Test-set evaluations", "Runs"), *lines]


def _overview(folders: Sequence[Path], wanted: Sequence[str], methods: Sequence[str]) -> str:
    """Return the table of page one with these methods, each from the first run that has it."""
    tables: list[list[list[str]]] = []
    places: dict[str, list[str]] = {}
    for run in map(read_published, folders):
        own = [name for name in methods if name in run.methods and name not in places]
        rows = text_rows(run, overview(run, own)[0], wanted)
        tables.append(rows)
        places |= dict(zip(run.ordered(own), rows[1:]))
    if absent := [name for name in methods if name not in places]:
        raise ValueError(f"no run of {', '.join(folder.name for folder in folders)} has {absent[0]}")
    if any(rows[0] != tables[0][0] for rows in tables):
        raise ValueError(f"runs {', '.join(folder.name for folder in folders)} have other columns")
    return markdown_table([tables[0][0], *(places[name] for name in methods)])


@cache
def _claims(*folders: Path) -> JudgedClaims:
    return judge_in_first([(folder.name, read_published(folder)) for folder in folders], TIMED)


def _of_methods(table: Table, methods: Sequence[str]) -> Table:
    """Return the table with the rows of these methods alone, of all where none is named.

    Raises:
        ValueError: for a method that the table has not.
    """
    place = next((place for place, column in enumerate(table.columns) if column.method), 0)
    known = {str(row[place]) for row in table.rows}
    if absent := [name for name in methods if name not in known]:
        raise ValueError(f"table {table.name} has no row of {absent[0]}; it has {', '.join(sorted(known))}")
    return replace(table, rows=tuple(row for row in table.rows if not methods or row[place] in methods))


@cache
def _table(folder: Path, name: str) -> Table:
    """Return a table of a run, having made no more tables than it takes to meet it."""
    run = read_published(folder)
    # Metrics declare many; most others have the name of the function that makes them.
    makers = sorted(TABLES, key=lambda make: getattr(make, "__name__", "") != name)
    of_others = chain.from_iterable(make(run) for make in makers)
    names = []
    for table in chain(metric_tables(run, name.removesuffix("_by_scene")), of_others):
        if table.name == name:
            return table
        names.append(table.name)
    raise ValueError(f"run {folder.name} has no table {name}; it has {', '.join(names)}")
