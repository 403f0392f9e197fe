"""What the PDF says, in the order it says it: a plain structure that the template lays out.

A section exists only where the run holds something for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from reports.configuration import configuration
from reports.data import Run
from reports.layout import Block, figure_block, list_block, table_blocks
from reports.narrative import summary
from reports.plotting import Picture
from reports.table import Table
from reports.tables import BY_SCENE, merged

QUESTION = (
    "A network can be trained on the physics of cloth alone, without one simulated frame. How close do its "
    "garments come to those of a converged solver, how do they compare with networks trained otherwise and "
    "with no network at all, and what does each cost?"
)
MAIN = "energies"  # the table on page one
# Figures stand behind the table of what they show.
FIGURES = {"energies": ("frames", "series"), "dynamics": ("hem",), "cost": ("throughput", "curves")}


def document(
    run: Run, tables: Mapping[str, Table], pictures: Sequence[Picture], problems: Sequence[str]
) -> dict[str, Any]:
    """Everything the template needs, as JSON-ready values."""
    lead = next((picture for picture in pictures if picture.kind == "lead"), None)
    shown = {p.kind: [q for q in pictures if q.kind == p.kind] for p in pictures}

    def blocks(*names: str) -> list[Block]:
        """Those of tables and of kinds of figures, by name."""
        found: list[Block] = []
        for name in names:
            found += [figure_block(picture) for picture in shown.pop(name, ())]
            found += table_blocks(run, tables[name]) if name in tables else ()
        return found

    declared = list(dict.fromkeys(metric.table for metric in run.metrics.values()))
    garments = [part for name in declared for part in (name if name != MAIN else "", *FIGURES.get(name, ()))]
    sections = {
        "Garments on moving bodies": blocks(
            *(name for name in garments if name != "speed"), "findings", "ablations", "ablation_effects"
        ),
        "Speed: error against run time": blocks("break_even", "crossings", "profile", "speed"),
        "Validation: known answers": blocks("validation") + _of_suite(run, tables, "validation"),
        "Extremes: where it breaks": blocks("maps") + _of_suite(run, tables, "extremes")
            + _not_converged(run, tables),
        "Performance: microbenchmarks, one process each": _of_suite(run, tables, "performance")
            + blocks("convergence"),
        "What did not run to its end": _trouble(run, tables, problems),
    }  # fmt: skip
    return {
        "title": "Neural garments beside a converged solver",
        "subtitle": _subtitle(run.config),
        "size": _size(run.config),
        "question": QUESTION,
        "findings": [list(finding) for finding in summary(run)],
        "lead": figure_block(lead) if lead else None,
        "main": blocks(MAIN),
        "sections": [{"title": title, "blocks": found} for title, found in sections.items() if found],
        "definitions": _definitions(run, tables.values()),
        "workers": _side_by_side(run.config),
        "configuration": configuration(run.config, run.frame),
    }


def _of_suite(run: Run, tables: Mapping[str, Table], suite: str) -> list[Block]:
    """What every declared table has scene by scene of a suite that is not averaged over scenes."""
    found: list[Block] = []
    for table in tables.values():
        if table.grouped_by == BY_SCENE:
            rows = [row for row in table.rows if row[0] == suite]
            places = range(1, len(table.columns))  # the first is the suite
            filled = [place for place in places if any(row[place] is not None for row in rows)]
            columns = tuple(table.columns[place] for place in filled)
            cells = tuple(tuple(row[place] for place in filled) for row in rows)
            own = replace(table, columns=columns, rows=cells, grouped_by=("scene",))
            found += table_blocks(run, own) if rows else ()
    return found


def _not_converged(run: Run, tables: Mapping[str, Table]) -> list[Block]:
    """The stress tests that did not converge; the CSV has all."""
    rows = [row for row in tables["extremes"].rows if row[2] != "converged"] if "extremes" in tables else []
    caption = "Stress tests that did not converge, and why; all the others are in tables/extremes.csv."
    return (
        list(table_blocks(run, replace(tables["extremes"], rows=tuple(rows), caption=caption)))
        if rows
        else []
    )


def _side_by_side(config: Mapping[str, Any]) -> str:
    count = config.get("workers")
    if not count:
        return "one thread each."
    together = "one after another" if count == 1 else f"up to {count} side by side"
    return f"{together}, one thread each."


def _subtitle(config: Mapping[str, Any]) -> str:
    parts = [f"preset {config['preset']}"] if config.get("preset") else []
    parts += [f"commit {config['commit']}"] if config.get("commit") else []
    parts += [str(config["started"])[:10]] if config.get("started") else []
    return " · ".join(parts)


def _size(config: Mapping[str, Any]) -> str:
    """What the preset says of itself; a smoke test says here that its numbers mean nothing."""
    values = config.get("preset_values")
    words = values.get("description") if isinstance(values, dict) else None
    return f"Preset {config.get('preset')}: {words}." if words else ""


def _trouble(run: Run, tables: Mapping[str, Table], problems: Sequence[str]) -> list[Block]:
    found: list[Block] = []
    if "unfinished" in tables:
        found += table_blocks(run, merged(tables["unfinished"], ("suite", "scene")))
    if problems:
        found.append(list_block("Files of this run that could not be read, missing above:", problems))
    return found


def _definitions(run: Run, tables: Iterable[Table]) -> list[dict[str, Any]]:
    """Of every metric that is a column of some table, as it declares itself, by table."""
    printed = {column.name for table in tables for column in table.columns}
    groups: dict[str, list[list[str]]] = {}
    for metric in run.metrics.values():
        if metric.name in printed and metric.table and metric.definition:
            groups.setdefault(metric.table, []).append([metric.heading, metric.definition])
    return [{"title": name.replace("_", " ").capitalize(), "pairs": pairs} for name, pairs in groups.items()]
