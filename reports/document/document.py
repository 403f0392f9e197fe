"""What the PDF says, in the order it says it: a plain structure that the template lays out.

It is to be read in minutes: what is long stands in tables/ and in report.html, and the last page says so. A
section exists only where the run holds something for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from reports.document.layout import (
    Block,
    figure_block,
    list_block,
    pairs_block,
    row_block,
    shortened,
    table_blocks,
)
from reports.document.narrative import changed, summary
from reports.document.verdict import endings, failures, verdict
from reports.figures.plotting import Picture
from reports.run.configuration import configuration
from reports.run.rows import Run
from reports.tables.table import Table
from reports.tables.tables import BY_SCENE, merged

PAPER = ("energies", "curvature", "cost")  # tables 1 to 3
EQUAL = "equal_data"
ROWS = 12  # of a table; the CSV has all
LETTERS = 90  # of a sentence on a failure
FILES = 12  # that could not be read


def document(
    run: Run, tables: Mapping[str, Table], pictures: Sequence[Picture], problems: Sequence[str]
) -> dict[str, Any]:
    """Everything the template needs, as JSON-ready values."""
    shown = {p.kind: [q for q in pictures if q.kind == p.kind] for p in pictures}

    def drawn(*kinds: str) -> list[Block]:
        return [figure_block(picture) for kind in kinds for picture in shown.get(kind, ())]

    def beside(*kinds: str) -> list[Block]:
        row = [picture for kind in kinds for picture in shown.get(kind, ())[:1]]
        return [row_block(row)] if row else []

    def printed(*names: str, most: int = ROWS) -> list[Block]:
        found = (shortened(tables[name], most) for name in names if name in tables)
        return [block for table in found for block in table_blocks(run, table)]

    sections = {
        "The paper's tables": printed(*PAPER),
        "Findings": [pairs_block(found) for found in [summary(run)] if found]
            + printed("findings", most=40) + printed("ablation_effects"),
        "Equal data": printed(EQUAL, most=60) + drawn("equal data"),
        "Error against run time": drawn("speed", "scenes") + beside("break_even", "sizes"),
        "Garments in motion": drawn("frames", "strip", "colours", "failures"),
        "Behind the means": drawn("dots", "histograms"),
        "Dynamics": printed("dynamics") + drawn("hem", "series"),
        "Body shapes": drawn("shapes") + printed("shapes"),
        "Validation": drawn("known answers") + _failed(run, tables),
        "Stress": drawn("maps") + _not_converged(run, tables),
        "Training": printed("trainings") + drawn("curves", "convergence") + _performance(run, tables),
        "What did not run to its end": _trouble(run, tables, problems),
    }  # fmt: skip
    return {
        "title": "Neural garments beside a converged solver",
        "subtitle": subtitle(run.config),
        "first": {
            "changed": changed(run),
            "size": _size(run.config),
            "verdict": [list(said) for said in verdict(run)],
            "blocks": [*drawn("lead row", "lead"), *printed("overview")],
            "endings": endings(run),
            "unread": f"{len(problems)} files could not be read: see the end." if problems else "",
            "failures": [[name, _cut(said)] for name, said in failures(run)],
        },
        "workers": _side_by_side(run.config),
        "configuration": configuration(run.config, run.frame),
        "sections": [{"title": title, "blocks": found} for title, found in sections.items() if found],
        "definitions": _definitions(run, (tables[name] for name in (*PAPER, "overview") if name in tables)),
        "spare": drawn("spare"),
        "elsewhere": [
            [f"tables/{table.name}.csv", _cut(table.caption)] for table in tables.values() if table.caption
        ],
    }


def _cut(text: str) -> str:
    return text if len(text) <= LETTERS else f"{text[: LETTERS - 1].rstrip()}…"


def _failed(run: Run, tables: Mapping[str, Table]) -> list[Block]:
    """The checks that failed."""
    made = tables.get("validation")
    rows = [row for row in made.rows if row[-1] not in ("pass", "reported")] if made else []
    if made is None or not rows:
        return []
    caption = "Checks that failed; all are in tables/validation.csv."
    return list(table_blocks(run, shortened(replace(made, rows=tuple(rows), caption=caption), ROWS)))


def _not_converged(run: Run, tables: Mapping[str, Table]) -> list[Block]:
    """The stress tests that did not converge; the CSV has all."""
    made = tables.get("extremes")
    rows = [row for row in made.rows if row[2] != "converged"] if made else []
    if made is None or not rows:
        return []
    rows = [(*row[:-1], _cut(str(row[-1]))) for row in rows]
    caption = "Stress tests that did not converge, and why; all are in tables/extremes.csv."
    return list(table_blocks(run, shortened(replace(made, rows=tuple(rows), caption=caption), ROWS)))


def _performance(run: Run, tables: Mapping[str, Table]) -> list[Block]:
    """The microbenchmarks, scene by scene."""
    found: list[Block] = []
    for table in tables.values():
        if table.grouped_by == BY_SCENE:
            rows = [row for row in table.rows if row[0] == "performance"]
            filled = [k for k in range(1, len(table.columns)) if any(row[k] is not None for row in rows)]
            columns = tuple(table.columns[place] for place in filled)
            cells = tuple(tuple(row[place] for place in filled) for row in rows)
            own = replace(table, columns=columns, rows=cells, grouped_by=("scene",))
            found += table_blocks(run, shortened(own, ROWS)) if rows else ()
    return found


def _side_by_side(config: Mapping[str, Any]) -> str:
    count = config.get("workers")
    if not count:
        return "one thread each."
    together = "one after another" if count == 1 else f"up to {count} side by side"
    return f"{together}, one thread each."


def subtitle(config: Mapping[str, Any]) -> str:
    """Preset, commit and day of a run."""
    parts = [f"preset {config['preset']}"] if config.get("preset") else []
    parts += [f"commit {config['commit']}"] if config.get("commit") else []
    parts += [str(config["started"])[:10]] if config.get("started") else []
    return " · ".join(parts)


def _size(config: Mapping[str, Any]) -> str:
    """What the preset says of itself; a smoke test says here that its numbers mean nothing."""
    values = config.get("preset_values")
    words = values.get("description") if isinstance(values, dict) else None
    return f"{words}" if words else ""


def _trouble(run: Run, tables: Mapping[str, Table], problems: Sequence[str]) -> list[Block]:
    found: list[Block] = []
    if "unfinished" in tables:
        made = tables["unfinished"]
        place = [column.name for column in made.columns].index("method")
        rows = [
            (*row[:place], run.label(str(row[place])), *row[place + 1 : -1],
                str(row[-1]).removeprefix(f"{row[place]} "))
            for row in made.rows
        ]  # fmt: skip
        made = merged(replace(made, rows=tuple(rows)), ("seed", "suite", "scene", "method"))
        made = replace(made, rows=tuple(tuple(_cut(str(cell)) for cell in row) for row in made.rows))
        found += table_blocks(run, shortened(made, ROWS))
    if problems:
        more = [f"and {len(problems) - FILES} more"] if len(problems) > FILES else []
        said = "Files of this run that could not be read, missing above:"
        found.append(list_block(said, [*problems[:FILES], *more]))
    return found


def _definitions(run: Run, tables: Iterable[Table]) -> list[list[str]]:
    """Of every metric that is a column of these tables, as it declares itself."""
    printed = {column.name for table in tables for column in table.columns}
    return [
        [metric.heading, metric.definition]
        for metric in run.metrics.values()
        if metric.name in printed and metric.definition
    ]
