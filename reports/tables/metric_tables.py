"""Tables that metrics declare: <table> by garment and method, <table>_by_scene scene by scene."""

from __future__ import annotations

import pandas as pd

from reports.run.finished_run import Run
from reports.tables.pivot import Pivot
from reports.tables.table import Table

BY_SCENE = ("suite", "scene")  # groups of a table that is not averaged over scenes


def metric_tables(run: Run) -> list[Table]:
    """Return the two tables of each name that metrics of the run declare."""
    names = list(dict.fromkeys(metric.table for metric in run.metrics.values() if metric.table))
    return [table for name in names for declared in declared_pivots(name) for table in declared(run)]


def declared_pivots(name: str) -> tuple[Pivot, Pivot]:
    """Declare the table of means over the scenes of a garment, and the one of every scene in all suites."""
    title = name.replace("_", " ").capitalize()
    by_garment = Pivot(
        name, f"{title}: mean over the scenes of each garment.", ("garment", "method"), of_table=name,
        select=lambda run: run.garment_rows, lines=_methods_of_garments, grouped_by=("garment",),
    )  # fmt: skip
    by_scene = Pivot(
        f"{name}_by_scene", f"{title}, scene by scene.", (*BY_SCENE, "method"), of_table=name,
        grouped_by=BY_SCENE,
    )  # fmt: skip
    return by_garment, by_scene


def _methods_of_garments(run: Run, rows: pd.DataFrame) -> set[tuple[str, ...]]:
    """Return (garment, method) without ablations, which stand beside their base, and perturbed references."""
    return {
        (str(garment), method)
        for garment, of_garment in rows.groupby("garment")
        for method in set(run.methods) - run.standing_apart(of_garment) - set(run.reference_ensemble)
    }
