"""A declared pivot: the rows, columns and cells of a table of means; the pivots that metrics declare.

A new table is one declaration in reports.tables.TABLES, for instance

    Pivot("by_part", "Cost by part of the motion.", rows=("part", "method"), metrics=("cost/frame",))
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass

import pandas as pd

from reports.run.finished_run import Metric, Run
from reports.statistics.means_and_spreads import means
from reports.tables.paper_values import NOTES, PRINTED
from reports.tables.table import GARMENT, METHOD, SCENE, SUITE, Cell, Column, Table, metric_column, table

BY_SCENE = ("suite", "scene")  # groups of a table that is not averaged over scenes
HEADS = {column.name: column for column in (METHOD, GARMENT, SCENE, SUITE)}


def all_cells(run: Run) -> pd.DataFrame:
    """Return the rows of all suites, each cell once."""
    return run.cells()


@dataclass(frozen=True)
class Pivot:
    """A table of means over scenes and seeds, see reports.statistics.means_and_spreads.

    rows: columns of results.csv whose values make the lines; the last is "method". metrics: names of the
    first columns, in order. of_table: then come all metrics that declare this table. select: rows of the run
    that count. lines: those that are shown, by the values of `rows`; all by default. grouped_by: of `rows`,
    those that become headings in the PDF. required: metric without which a line is left out.
    """

    name: str
    caption: str
    rows: tuple[str, ...] = ("scene", "method")
    metrics: tuple[str, ...] = ()
    of_table: str = ""
    select: Callable[[Run], pd.DataFrame] = all_cells
    lines: Callable[[Run, pd.DataFrame], Container[tuple[str, ...]]] | None = None
    grouped_by: tuple[str, ...] = ()
    required: str = ""

    def __call__(self, run: Run) -> list[Table]:
        """Return the table in a list, which is empty where the run has no number for it."""
        frame = self.select(run)
        declared = (frame["table"] == self.of_table) & (self.of_table != "")
        wanted = frame[frame["metric"].isin(self.metrics) | declared]
        metrics, lines = pivot(run, frame, wanted, self.rows, self.metrics)
        names = [metric.name for metric in metrics]
        width = len(self.rows)
        if self.required:
            place = width + names.index(self.required) if self.required in names else None
            lines = [line for line in lines if place is not None and line[place] is not None]
        if self.lines is not None:
            shown = self.lines(run, wanted)
            lines = [line for line in lines if line[:width] in shown]
        heads = [HEADS.get(name, Column(name, name.capitalize(), text=True)) for name in self.rows]
        return table(
            self.name, (*heads, *map(metric_column, metrics)), lines, self.caption,
            grouped_by=self.grouped_by,
            references=tuple(PRINTED.get(self.name, {}).items()), note=NOTES.get(self.name, ""),
        )  # fmt: skip


def pivot(
    run: Run, frame: pd.DataFrame, wanted: pd.DataFrame, keys: tuple[str, ...], first: Sequence[str] = ()
) -> tuple[list[Metric], list[tuple[Cell, ...]]]:
    """Compute means of the frame, a line for each value of the keys, a column for each metric.

    Args:
        run: the run.
        frame: rows of it; those that failed say what a mean lacks.
        wanted: rows of the frame whose metrics become columns.
        keys: columns of results.csv that name a line, the last of them "method".
        first: metrics that come before the others.
    """
    usable = set(wanted[wanted["usable"]]["metric"])
    metrics = [run.metrics[name] for name in dict.fromkeys((*first, *run.metrics)) if name in usable]
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


def metric_tables(run: Run, only: str = "") -> list[Table]:
    """Return the two tables of each name that metrics of the run declare, or of the name `only`."""
    declared_names = dict.fromkeys(metric.table for metric in run.metrics.values() if metric.table)
    names = [name for name in declared_names if only in ("", name)]
    return [table for name in names for declared in declared_pivots(name) for table in declared(run)]


def declared_pivots(name: str) -> tuple[Pivot, Pivot]:
    """Declare the table of means over the scenes of a garment, and the one of every scene in all suites."""
    title = name.replace("_", " ").capitalize()
    which = "timed" if name == "cost" else "the"
    caption = f"{title}: mean over {which} motions and seeds of each garment."
    by_garment = Pivot(
        name, caption, ("garment", "method"), of_table=name,
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
