"""Tables of textile tests: drape on meshes and time steps, published bands, order of fabrics by solvers."""

from __future__ import annotations

import re

from reports.run.finished_run import Run
from reports.statistics.fabric.order import APART, ERROR, order, readings, rows_of_test
from reports.statistics.means_and_spreads import means
from reports.statistics.pareto import TIME
from reports.tables.table import METHOD, Cell, Column, Table, table

DRAPE_CASE = re.compile(r"drape_(?P<fabric>\w+)_(?P<rings>\d+)_rings_(?P<rate>\d+)_steps")
BAND_CASE = re.compile(r"drape_band_(?P<fabric>\w+)_(?P<end>least|largest)")
BENDING_LENGTH = re.compile(r"bending length ([\d.]+) mm")
COEFFICIENT = re.compile(r"([\d.]+) %$")


def fabric_drape(run: Run) -> list[Table]:
    """Tabulate the reference's drape coefficient of each fabric, on several meshes and at several steps."""
    values: dict[str, dict[tuple[int, int], float]] = {}
    lengths: dict[str, float] = {}
    for name, description, value in _cases(run):
        if match := DRAPE_CASE.fullmatch(name):
            fabric = match["fabric"]
            values.setdefault(fabric, {})[int(match["rings"]), int(match["rate"])] = value
            length = BENDING_LENGTH.search(description)
            lengths[fabric] = float(length[1]) if length else float("nan")
    sizes = sorted({size for of_fabric in values.values() for size in of_fabric}, key=lambda s: (s[1], s[0]))
    columns = (
        Column("fabric", "Fabric", text=True),
        Column("bending_length", "Bending length", "mm"),
        *(Column(f"rings_{r}_steps_{s}", f"{r} rings, {s} steps/s", "%") for r, s in sizes),
    )
    lines: list[tuple[Cell, ...]] = [
        (fabric, lengths[fabric], *(of_fabric.get(size) for size in sizes))
        for fabric, of_fabric in values.items()
    ]
    caption = "Drape coefficient by the reference on several meshes and at several time steps."
    return table("fabric_drape", columns, lines, caption)


def fabric_bands(run: Run) -> list[Table]:
    """Tabulate published drape coefficients, and the bending lengths that give them by the reference."""
    bands: dict[str, dict[str, tuple[float, float]]] = {}
    for name, description, value in _cases(run):
        coefficient = COEFFICIENT.search(description)
        if (match := BAND_CASE.fullmatch(name)) and coefficient:
            bands.setdefault(match["fabric"], {})[match["end"]] = (float(coefficient[1]), value)
    lines: list[tuple[Cell, ...]] = [
        (fabric, *(ends[end][place] for place in (0, 1) for end in ("least", "largest")))
        for fabric, ends in bands.items()
        if len(ends) == 2
    ]
    columns = (
        Column("class", "Class", text=True),
        Column("least", "Published, least", "%"), Column("largest", "Published, largest", "%"),
        Column("length_least", "Bending length, least", "mm"),
        Column("length_largest", "Bending length, largest", "mm"),
    )  # fmt: skip
    caption = (
        "Published drape coefficients, and the bending lengths that give them by the reference, of fabrics "
        "of one density."
    )
    return table("fabric_bands", columns, lines, caption)


def _cases(run: Run) -> list[tuple[str, str, float]]:
    """Return name, description and value of each usable case of the suite."""
    declared = run.config.get("cases") or {}
    rows = run.suite("fabric")
    rows = rows[(rows["case"] != "") & rows["usable"]]
    return [
        (str(name), str((declared.get(name) or {}).get("description", "")), float(value))
        for name, value in rows[["case", "value"]].itertuples(index=False)
    ]


def fabric_order(run: Run) -> list[Table]:
    """Tabulate each method's errors in both tests, and the pairs of fabrics that it turns round."""
    read = {test: readings(run, test) for test in APART}
    errors = {test: means(rows_of_test(run, test), "method", "metric") for test in APART}
    methods = run.ordered({method for of_test in read.values() for method in of_test})
    lines: list[tuple[Cell, ...]] = []
    for method in methods:
        counts, worst = [], ""
        for test, of_test in read.items():
            reference = of_test.get(run.reference, {})
            ranking = order(of_test.get(method, {}), reference, APART[test])
            counts.append(f"{len(ranking.turned)} of {ranking.pairs}" if ranking.pairs else "")
            if ranking.turned:
                worst = f"{ranking.turned[0][0]} above {ranking.turned[0][1]} ({test})"
        lines.append((
            method, errors["drape"].get((method, TIME)),
            errors["cantilever"].get((method, ERROR)), errors["drape"].get((method, ERROR)), *counts, worst,
        ))  # fmt: skip
    columns = (
        METHOD, Column("time", "Drape, run time", "ms"),
        Column("cantilever_error", "Error of the bending length", "%"),
        Column("drape_error", "Error of the drape coefficient", "points"),
        Column("cantilever_turned", "Pairs turned, bending length", text=True),
        Column("drape_turned", "Pairs turned, drape", text=True),
        Column("worst", "For instance", text=True),
    )  # fmt: skip
    caption = (
        "Textile tests by each method: mean errors over the fabrics, and pairs of fabrics whose order is not "
        f"the reference's, of those it has {APART['cantilever']:g} mm or {APART['drape']:g} points apart."
    )
    return table("fabric_order", columns, lines, caption)
