"""Tables that metrics declare: means over the motions of a garment, or of scenes where nothing is worn."""

from __future__ import annotations

import pandas as pd

from benchmarks.metric import Metric
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import means
from reports.tables.paper_values import NOTES, PRINTED
from reports.tables.table import GARMENT, METHOD, SCENE, SUITE, Cell, Table, metric_column, table


def metric_tables(run: Run, only: str = "") -> list[Table]:
    """Return the table of each name that metrics of the run declare, or of the name `only`.

    Where no garment has a number of it, the table is NAME_by_scene.
    """
    declared = dict.fromkeys(metric.table for metric in run.metrics.values() if metric.table)
    names = [name for name in declared if only in ("", name)]
    return [made for name in names for made in _by_garment(run, name) or _by_scene(run, name)]


def _by_garment(run: Run, name: str) -> list[Table]:
    """Tabulate means over the motions of each garment, with the values that the paper printed.

    Ablations, which stand beside their base, and perturbed references are left out.
    """
    title = name.replace("_", " ").capitalize()
    which = "timed" if name == "cost" else "the"
    metrics, lines = pivot(run, run.garment_rows, name, ("garment", "method"))
    apart = {
        garment: run.standing_apart(rows) | set(run.reference_ensemble)
        for garment, rows in run.garment_rows[run.garment_rows["table"] == name].groupby("garment")
    }
    return table(
        name, (GARMENT, METHOD, *map(metric_column, metrics)),
        [line for line in lines if line[1] not in apart[line[0]]],
        f"{title}: mean over {which} motions and seeds of each garment.", grouped_by=("garment",),
        references=tuple(PRINTED.get(name, {}).items()), note=NOTES.get(name, ""),
    )  # fmt: skip


def _by_scene(run: Run, name: str) -> list[Table]:
    """Tabulate means over seeds in each scene."""
    metrics, lines = pivot(run, run.cells(), name, ("suite", "scene", "method"))
    columns = (SUITE, SCENE, METHOD, *map(metric_column, metrics))
    caption = f"{name.replace('_', ' ').capitalize()}, scene by scene."
    return table(f"{name}_by_scene", columns, lines, caption, grouped_by=("suite", "scene"))


def pivot(
    run: Run, frame: pd.DataFrame, name: str, keys: tuple[str, ...]
) -> tuple[list[Metric], list[tuple[Cell, ...]]]:
    """Compute means of the frame, a line for each value of the keys, a column for each metric.

    Args:
        run: the run.
        frame: rows of it; those that failed say what a mean lacks.
        name: of the table that the metrics declare.
        keys: columns of results.csv that name a line, the last of them "method".
    """
    wanted = frame[frame["table"] == name]
    usable = set(wanted[wanted["usable"]]["metric"])
    metrics = [metric for metric in run.metrics.values() if metric.name in usable]
    if not metrics:
        return [], []
    cells = means(frame[frame["metric"].isin(usable) | ~frame["usable"]], *keys, "metric")
    wide = cells.unstack("metric", sort=False).astype(object)
    wide = wide.where(wide.notna(), None)[[metric.name for metric in metrics]]
    methods = {method: place for place, method in enumerate(run.ordered(wide.index.get_level_values(-1)))}
    garments = {garment: place for place, garment in enumerate(run.garments(wanted))}
    outer = {key[:-1]: place for place, key in reversed(list(enumerate(wide.index)))}
    last = len(keys) - 1

    def order(line: tuple[Cell, ...]) -> tuple[int, int, int]:
        """Garments as declared, other outer keys as they come, methods in their order."""
        garment = garments[str(line[0])] if keys[0] == "garment" else 0
        return garment, outer[line[:last]], methods[str(line[last])]

    lines = ((*key, *line) for key, line in zip(wide.index, wide.itertuples(index=False)))
    return metrics, sorted(lines, key=order)
