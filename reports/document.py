"""What the PDF says, in the order it says it: a plain structure that the template lays out.

A section exists only where the run holds something for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.results import Row
from reports import ablations, bars, study_tables
from reports import findings as paper_findings
from reports.canvas import Picture
from reports.configuration import configuration
from reports.layout import Block, figure_block, list_block, table_block
from reports.numbers import DASH
from reports.summary import Mean, Measurements
from reports.table import Cell, Table
from reports.words import findings

QUESTION = (
    "A network can be trained on the physics of cloth alone, without one simulated frame. How close do its "
    "garments come to those of a converged solver, how do they compare with networks trained otherwise and "
    "with no network at all, and what does each cost?"
)

CAPTIONS = {
    "energies": "Energy by term on unseen motions, J per frame: mean over frames, then over test scenes.",
    "curvature": "Mean-curvature error against the simulation, and the mean curvature itself.",
    "cost": "What each method costs; run time is measured one frame at a time.",
    "penetration": "Vertices below the skin, those deeper than 5 mm, 99.9 % depth below a vertex's own part "
    "of the body, drift of the hem; distance to the simulation, RMS and 95 %, and its floor.",
    "shape": "Shape of the cloth: mean change of edges and areas against rest, mean angle of folds, "
    "triangles that cut others, distance of the curvature histogram from the simulation's.",
    "dynamics": "Dynamics of the hem beside the simulation's, networks less their own output with each pose "
    "held, solvers less the static minimum: A is the ratio of amplitudes; distance from that output (held).",
    "energies_by_scene": "Energy by term, scene by scene, J per frame.",
    "answers": "SNUG on each scene: what is no slower and no less accurate, the fastest solver alone with at "
    "most its error, the fastest solver that starts from a network or skinning, has less error than SNUG and "
    "is overtaken by no solver alone; frames after which training pays against the converged simulation, and "
    "against that solver.",
    "crossings": "From how many frames on the training of a network pays, against the converged simulation "
    "and the fastest solvers with at most SNUG's error; a dash: never.",
    "speed": "The points of the plots: run time of one frame; relative energy gap, gradient left, errors of "
    "mean curvature and of its histogram, distance to the simulation, total energy above it.",
    "validation": "Measured and expected value of every check.",
    "extremes": "Every extreme case and how it ended.",
    "refusals": "Inputs that have to be refused before anything is solved, and what each was told.",
    "unfinished": "Cells that failed or were skipped, with the reason each gave.",
    "bars": bars.CAPTION,
    **ablations.CAPTIONS,
    **paper_findings.CAPTIONS,
    **study_tables.CAPTIONS,
}

# Tables 1 to 3 of the paper, as it prints them, by column. A column that it does not report is a dash.
PAPER = {
    "energies": {
        "PBNS, in the paper": {
            "strain": "0.111", "bending": "0.007", "gravity": "0.044", "inertia": "0.0035",
        },
        "SNUG, in the paper": {
            "strain": "0.064", "bending": "0.004", "gravity": "0.028", "inertia": "0.0034",
        },
    },
    "curvature": {"SNUG, in the paper": {"error": "2.7"}},
    "cost": {
        "TailorNet, in the paper": {
            "data_generation": "29 h", "training": "6.5 h", "run_time": "10.1", "memory": "2114",
        },
        "Santesteban 2019, in the paper": {
            "data_generation": "180 h", "training": "17 h", "run_time": "2.5", "memory": "109",
        },
        "SNUG, in the paper": {
            "data_generation": "0 h", "training": "2 h", "run_time": "2.2", "memory": "19",
        },
    },
}  # fmt: skip

BY_GARMENT = (
    "energies", "curvature", "dynamics", "penetration", "shape", "cost", "ablations", "ablations_judged",
    "crossings",
)  # fmt: skip
GROUPED = {
    "energies_by_scene": ("scene",),
    "speed": ("scene",),
    "answers": ("scene",),
    "recipes": ("base",),
    **dict.fromkeys(BY_GARMENT, ("garment",)),
    **study_tables.GROUPED,
}
NOTES = {
    "energies": "In grey the values printed by the paper, for its own garment, motions, contact and zero of "
    "gravity: for orientation only, they enter no mean of ours.",
    "curvature": "In grey the paper's value, whose operator and unit it does not state.",
    "cost": "In grey the values printed by the paper, on its own machine with a GPU.",
}


def document(
    config: dict[str, Any],
    rows: Sequence[Row],
    tables: dict[str, Table],
    pictures: Sequence[Picture],
    problems: Sequence[str],
) -> dict[str, Any]:
    """Everything the template needs, as JSON-ready values."""
    lead = next((picture for picture in pictures if picture.kind == "speed"), None)
    rest = [picture for picture in pictures if picture is not lead]
    sections = [
        {"title": "Garments on moving bodies", "blocks": _garments(tables, rest)},
        {
            "title": "Speed: error against run time",
            "blocks": [
                block
                for kind in ("break_even", "profile", "speed")
                for block in _figures(rest, "speed", kind)
            ]
            + _tables(tables, "answers", "crossings", "speed"),
        },
        {
            "title": "Validation: known answers",
            "blocks": _figures(rest, "validation", "dots") + _tables(tables, "laws", "validation"),
        },
        {
            "title": "Extremes: where it breaks",
            "blocks": _figures(rest, "extremes", "maps")
            + _figures(rest, "extremes", "outcomes")
            + _tables(tables, "hard_motions", "hard_aftermath", "extremes", "refusals"),
        },
        {"title": "What did not run to its end", "blocks": _trouble(tables, problems)},
    ]
    return {
        "title": "Neural garments beside a converged solver",
        "subtitle": _subtitle(config),
        "size": _size(config),
        "question": QUESTION,
        "findings": [list(finding) for finding in findings(rows)],
        "lead": figure_block(lead) if lead else None,
        "sections": [section for section in sections if section["blocks"]],
        "definitions": _definitions(rows),
        "workers": _side_by_side(config),
        "configuration": configuration(config, rows),
    }


def _side_by_side(config: dict[str, Any]) -> str:
    count = config.get("workers")
    if not count:
        return "one thread each."
    together = "one after another" if count == 1 else f"up to {count} side by side"
    return f"{together}, one thread each."


def _subtitle(config: dict[str, Any]) -> str:
    parts = [f"preset {config['preset']}"] if config.get("preset") else []
    parts += [f"commit {config['commit']}"] if config.get("commit") else []
    parts += [str(config["started"])[:10]] if config.get("started") else []
    return " · ".join(parts)


def _size(config: dict[str, Any]) -> str:
    """What the preset says of itself; a smoke test says here that its numbers mean nothing."""
    values = config.get("preset_values")
    words = values.get("description") if isinstance(values, dict) else None
    return f"Preset {config.get('preset')}: {words}." if words else ""


def _figures(pictures: Sequence[Picture], section: str, kind: str) -> list[Block]:
    return [figure_block(p) for p in pictures if p.section == section and p.kind == kind]


def _tables(tables: dict[str, Table], *names: str) -> list[Block]:
    return [
        table_block(tables[name], CAPTIONS[name], grouped_by=GROUPED.get(name, ()))
        for name in names
        if name in tables
    ]


def _with_paper(tables: dict[str, Table], name: str) -> list[Block]:
    """One of the paper's tables, with the paper's own rows set apart below ours."""
    if name not in tables:
        return []
    table = tables[name]
    references = [
        (label, [values.get(column.name, DASH) for column in table.columns[2:]])
        for label, values in PAPER[name].items()
    ]
    block = table_block(
        table, CAPTIONS[name], references=references, note=NOTES[name], grouped_by=GROUPED[name]
    )
    return [block]


def _garments(tables: dict[str, Table], pictures: Sequence[Picture]) -> list[Block]:
    return [
        *_with_paper(tables, "energies"),
        *_figures(pictures, "garments", "frames"),
        *_figures(pictures, "garments", "series"),
        *_figures(pictures, "garments", "hem"),
        *_with_paper(tables, "curvature"),
        *_tables(tables, "dependence", "dynamics", "penetration", "shape"),
        *_with_paper(tables, "cost"),
        *_figures(pictures, "garments", "throughput"),
        *_judged(tables),
        *_tables(tables, "ablations", "ablations_judged", "bars", "recipes"),
        *_figures(pictures, "garments", "speed"),
        *_figures(pictures, "garments", "training"),
        *_tables(tables, "energies_by_scene"),
    ]


def _judged(tables: dict[str, Table]) -> list[Block]:
    """The paper's findings that this run can judge; how many it cannot is said below."""
    if "findings" not in tables:
        return []
    table = tables["findings"]
    kept = tuple(row for row in table.rows if row[-1] is not None)
    left = len(table.rows) - len(kept)
    note = f"{left} more need methods that this run left out: see tables/findings.csv." if left else ""
    if not any(isinstance(cell, Mean) and cell.spread is not None for row in kept for cell in row):
        note = f"With one seed, 5 % count as the scatter of seeds. {note}"
    return (
        [table_block(Table(table.name, table.columns, kept), CAPTIONS["findings"], note=note)] if kept else []
    )


def _trouble(tables: dict[str, Table], problems: Sequence[str]) -> list[Block]:
    blocks: list[Block] = []
    if "unfinished" in tables:
        short = merged(merged(tables["unfinished"], "suite"), "scene")
        blocks.append(table_block(short, CAPTIONS["unfinished"]))
    if problems:
        blocks.append(list_block("Files of this run that could not be read, missing above:", problems))
    return blocks


def merged(table: Table, name: str) -> Table:
    """Lines that differ in the column `name` alone, as one line with all that stands there."""
    place = [column.name for column in table.columns].index(name)
    found: dict[tuple[Cell, ...], list[str]] = {}
    for row in table.rows:
        found.setdefault((*row[:place], *row[place + 1 :]), []).append(str(row[place]))
    rows = tuple((*key[:place], ", ".join(words), *key[place:]) for key, words in found.items())
    return Table(table.name, table.columns, rows)


def _definitions(rows: Sequence[Row]) -> list[str]:
    """Which definitions to print: those of what was measured."""
    metrics = set(Measurements(rows).metrics)
    wanted = {
        "strain": "energy/strain",
        "bending": "energy/bending",
        "gravity": "energy/gravity",
        "inertia": "energy/inertia",
        "collision": "energy/collision",
        "total": "energy/total",
        "scatter": "energy/total",
        "curvature": "curvature/mean",
        "curvature_difference": "curvature/mean_difference",
        "distance": "distance/rms",
        "penetration": "penetration/vertices",
        "own_part": "penetration/own_part_p999",
        "gap": "gap/relative",
        "gradient": "gradient/norm",
        "histogram": "curvature/histogram",
        "floor": "distance/floor",
        "deformation": "deformation/edges",
        "intersections": "intersections/triangles",
        "dynamics": "dynamics/amplitude",
        "held": "dynamics/held_difference",
        "cost": "cost/frame",
    }
    return [name for name, metric in wanted.items() if metric in metrics]
