"""The tables of a run: which numbers stand in which row and column.

A metric declares the table in which it is a column, so most tables make themselves: <table> has a row for
each garment and method, <table>_by_scene one for each scene and method. What was not measured is None, and
printed as a dash.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from reports.figures.break_even import crossings
from reports.figures.equal_data import equal_data
from reports.figures.shapes import shapes
from reports.run.rows import SUITES, Run
from reports.statistics.claims import findings
from reports.statistics.means import means
from reports.statistics.pareto import ERRORS, TIME, WHOLE
from reports.tables import paper
from reports.tables.ablations import ablation_effects, ablations
from reports.tables.overview import overview
from reports.tables.table import Cell, Column, Table, metric_column, table

BY_SCENE = ("suite", "scene")  # what groups the lines of a table that is not averaged over scenes
METHOD = Column("method", "Method", text=True, method=True)
GARMENT, SCENE, SUITE = (Column(name, name.capitalize(), text=True) for name in ("garment", "scene", "suite"))
REASON = Column("reason", "Reason", text=True)
BAD = ("failed", "diverged", "timeout", "out-of-memory", "stalled")  # the worst first


def make_tables(run: Run) -> dict[str, Table]:
    """Every table the rows have something for, by name."""
    names = list(dict.fromkeys(metric.table for metric in run.metrics.values() if metric.table))
    found = [made for name in names for made in (*by_garment(run, name), *by_scene(run, name))]
    for make in (
        overview, findings, equal_data, ablations, ablation_effects, crossings, speed, shapes, validation,
        extremes, endings, unfinished, metrics,
    ):  # fmt: skip
        found += make(run)
    return {made.name: made for made in found}


def by_garment(run: Run, name: str) -> list[Table]:
    """Means over the scenes of each garment in suite garments. Ablations beside their base stand apart, and
    simulations that are as right as the reference are what a number's uncertainty says.
    """
    rows = run.worn[run.worn["table"] == name]
    place = {garment: place for place, garment in enumerate(run.garments(rows))}
    apart = {garment: run.standing_apart(own) for garment, own in rows.groupby("garment")}
    columns, lines = _pivot(run, _with_failed(run.worn, rows), rows, ("garment", "method"))
    lines = [line for line in lines if line[1] not in (*apart[line[0]], *run.twins)]
    lines.sort(key=lambda line: place[line[0]])
    title = name.replace("_", " ").capitalize()
    return table(
        name, (GARMENT, METHOD, *columns), lines, f"{title}: mean over the scenes of each garment.",
        grouped_by=("garment",), references=tuple(paper.PRINTED.get(name, {}).items()),
        note=paper.NOTES.get(name, ""),
    )  # fmt: skip


def by_scene(run: Run, name: str) -> list[Table]:
    """The same scene by scene, in every suite. A cell of several suites stands in the first of them."""
    kept = run.cells(*SUITES)
    columns, lines = _pivot(run, kept, kept[kept["table"] == name], ("suite", "scene", "method"))
    title = name.replace("_", " ").capitalize()
    return table(
        f"{name}_by_scene", (SUITE, SCENE, METHOD, *columns), lines, f"{title}, scene by scene.",
        grouped_by=BY_SCENE,
    )  # fmt: skip


def _with_failed(frame: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """The rows and those of cells that failed, whatever metric these would have given."""
    return frame.loc[rows.index.union(frame.index[~frame["usable"]])]


def _pivot(
    run: Run, frame: pd.DataFrame, rows: pd.DataFrame, keys: tuple[str, ...], first: tuple[str, ...] = ()
) -> tuple[list[Column], list[tuple]]:
    """Columns of these rows' metrics, `first` before the rest; lines of keys and of means over the frame."""
    usable = set(rows[rows["usable"]]["metric"])
    chosen = [run.metrics[name] for name in dict.fromkeys((*first, *run.metrics)) if name in usable]
    if not chosen:
        return [], []
    found = means(frame[frame["metric"].isin(usable) | ~frame["usable"]], *keys, "metric")
    wide = found.unstack("metric", sort=False).astype(object)
    wide = wide.where(wide.notna(), None)[[metric.name for metric in chosen]]
    place = {method: place for place, method in enumerate(run.ordered(wide.index.get_level_values("method")))}
    lines = sorted(
        ((*key, *line) for key, line in zip(wide.index, wide.itertuples(index=False))),
        key=lambda line: place[line[len(keys) - 1]],
    )
    if len(keys) > 1:  # back into the order of the outer keys, methods in theirs
        outer = {key[:-1]: place for place, key in reversed(list(enumerate(wide.index)))}
        lines.sort(key=lambda line: outer[line[: len(keys) - 1]])
    return [metric_column(metric) for metric in chosen], lines


def speed(run: Run) -> list[Table]:
    """Every point of the plots of error against run time, in the scenes of suite speed."""
    cells = run.cells("speed", "garments")
    rows = cells[cells["scene"].isin(run.suite("speed")["scene"])]
    own = [name for name, metric in run.metrics.items() if metric.table == "speed"]
    first = (TIME, WHOLE, *ERRORS)
    kept = rows[rows["metric"].isin([*first, *own])]
    columns, lines = _pivot(run, rows, kept, ("scene", "method"), first)
    timed = [place for place, column in enumerate(columns, 2) if column.name == TIME]
    lines = [line for line in lines if timed and line[timed[0]] is not None]
    caption = "Run time of a frame and errors, scene by scene: the points of the plots."
    return table("speed", (SCENE, METHOD, *columns), lines, caption, grouped_by=("scene",))


def validation(run: Run) -> list[Table]:
    """Measured against expected, each with its tolerance; without one it is reported, not judged."""
    lines = [
        (
            check_name(run, row),
            row.unit,
            row.value,
            row.expected,
            row.tolerance,
            tolerances_away(row),
            _result(row),
        )
        for row in checks(run).itertuples()
    ]
    columns = (
        Column("check", "Check", text=True),
        Column("unit", "Unit", text=True),
        Column("measured", "Measured", digits=7, trim=True),
        Column("expected", "Expected", digits=7, trim=True),
        Column("tolerance", "Tolerance", digits=2, trim=True),
        Column("away", "Tolerances away", digits=2),
        Column("status", "Result", text=True),
    )
    return table("validation", columns, lines, "Checks with a known answer.")


def tolerances_away(row) -> float | None:
    """|measured - expected| / tolerance; a number that must be exact is 0 or infinitely many away."""
    distance = abs(row.value - row.expected)
    if pd.isna(distance) or pd.isna(row.tolerance):
        return None
    if row.tolerance:
        return distance / row.tolerance
    return math.inf if distance else 0.0


def checks(run: Run) -> pd.DataFrame:
    """The cases of suite validation, and what any other suite judges by a tolerance."""
    is_case, rows = run.frame["case"] != "", run.frame
    asked = np.where(is_case, rows["suite"] == "validation", rows["tolerance"].notna())
    return rows[asked & (rows["status"] != "skipped")]


def check_name(run: Run, row) -> str:
    """The case, or the scene and what is judged there."""
    return row.case or f"{row.scene}: {run.metrics[row.metric].title}"


def _result(row) -> str:
    if row.status != "ok":
        return row.status
    return "reported" if pd.isna(row.tolerance) else "pass"


def extremes(run: Run) -> list[Table]:
    """How each stress test ended, with the gradient left; points of maps over options stand in a figure."""
    rows = stress_tests(run)
    lines = [(r.scene, r.method, "converged" if r.status == "ok" else r.status, r.value, r.reason)
        for r in rows.itertuples()]  # fmt: skip
    unit = rows["unit"].iloc[0] if len(rows) else ""
    columns = (
        Column("case", "Case", text=True),
        Column("method", "Method", text=True, method=True),
        Column("outcome", "Outcome", text=True),
        Column("gradient", "Largest gradient", unit, digits=2, trim=True),
        Column("reason", "In words", text=True),
    )
    return table("extremes", columns, lines, "Every stress test and how it ended.")


def stress_tests(run: Run) -> pd.DataFrame:
    """The rows of single cases of suite extremes."""
    rows = run.suite("extremes")
    return rows[(rows["case"] != "") & ~rows["case"].isin(map_points(run)) & (rows["status"] != "skipped")]


def map_points(run: Run) -> dict[str, tuple[float, float]]:
    """Case -> factor on the stiffness and time step [s], of the cases of stability maps."""
    cases = run.config.get("cases") or {}
    points = {name: case.get("map_point") for name, case in cases.items()}
    return {name: (float(point[0]), float(point[1])) for name, point in points.items() if point}


def endings(run: Run) -> list[Table]:
    """How many cells, checks and stress tests ended how."""
    ends = ("ok", *BAD, "skipped")
    lines: list[tuple[Cell, ...]] = [
        (what, *(counts[end] for end in ends), sum(counts.values())) for what, counts in counted(run).items()
    ]
    columns = [Column(name, name.capitalize()) for name in (*ends, "all")]
    return table("endings", (Column("what", "What", text=True), *columns), lines, "How many ended how.")


def counted(run: Run) -> dict[str, Counter[str]]:
    """Cells, checks and stress tests, those there are -> how many ended how."""
    cells = run.frame[(run.frame["case"] == "") & (run.frame["method"] != "")]
    best_first = {"stalled": 0, "ok": 1}  # what has any usable number has run, whatever became of the others
    cells = cells.sort_values("status", key=lambda s: s.map(best_first).fillna(2), kind="stable")
    judged = checks(run)
    groups = {
        "cells": cells.drop_duplicates(["suite", "scene", "method", "seed"]),
        "checks": judged[judged["tolerance"].notna() | (judged["status"] != "ok")],
        "stress tests": stress_tests(run),
    }
    return {what: Counter(rows["status"]) for what, rows in groups.items() if len(rows)}


def unfinished(run: Run) -> list[Table]:
    """Every cell that failed or was skipped, once per reason, whatever the number of its metrics."""
    judged_elsewhere = (run.frame["case"] != "") & (run.frame["status"] != "skipped")
    rows = run.frame[(run.frame["status"] != "ok") & ~judged_elsewhere]
    names = ["suite", "scene", "method", "seed", "status", "reason"]
    lines = rows[names].drop_duplicates().itertuples(index=False)
    columns = (SUITE, Column("scene", "Scene", text=True),
        Column("method", "Method", text=True, method=True),
        Column("seed", "Seed", text=True), Column("status", "Status", text=True), REASON)  # fmt: skip
    cells = [(*line[:5], line[5] or "no reason given") for line in lines]
    return table("unfinished", columns, cells, "Cells that failed or were skipped, with the reason of each.")


def metrics(run: Run) -> list[Table]:
    """Everything measured, one line per suite, scene, method and metric: the file to plot from."""
    found = means(run.frame[run.frame["method"] != ""], "suite", "scene", "method", "metric")
    lines: list[tuple[Cell, ...]] = [
        (*key[:4], run.metrics[key[3]].unit, mean, mean.seeds) for key, mean in found.items()
    ]
    names = ("suite", "scene", "method", "metric", "unit", "value", "seeds")
    return table("metrics", [Column(name, name) for name in names], lines)


def merged(made: Table, names: Iterable[str]) -> Table:
    """Lines that differ in one of the columns alone, as one line with all that stands there."""
    rows: Sequence[tuple[Cell, ...]] = made.rows
    for place in [place for place, column in enumerate(made.columns) if column.name in set(names)]:
        found: dict[tuple[Cell, ...], list[str]] = {}
        for row in rows:
            found.setdefault((*row[:place], *row[place + 1 :]), []).append(str(row[place]))
        rows = [(*key[:place], ", ".join(words), *key[place:]) for key, words in found.items()]
    return Table(made.name, made.columns, tuple(rows), made.caption)
