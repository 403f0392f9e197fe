"""Tables that metrics declare, of ablations and of body shapes: means over the motions of a garment."""

from __future__ import annotations

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import SECOND_STARTS
from reports.finished_run import Run
from reports.statistics.means_and_spreads import means
from reports.statistics.relative_excess import SKINNING, TOTAL, excess_of
from reports.statistics.verdicts import compare_methods, measure_of
from reports.tables.table import GARMENT, METHOD, SCENE, SUITE, Cells, Column, Table, metric_column, table


def metric_tables(run: Run) -> list[Table]:
    """Return the table of each name that metrics of the run declare.

    Where no garment has a number of it, the table is NAME_by_scene.
    """
    names = dict.fromkeys(metric.table for metric in run.metrics.values() if metric.table)
    return [table for name in names for table in _average_motions(run, name) or _average_seeds(run, name)]


PAPER_COSTS = (
    "In table 3 of the paper, on another machine, with a GPU: TailorNet 29 h of data, 6.5 h of training, "
    "10.1 ms, 2114 MB; Santesteban 2019 180 h, 17 h, 2.5 ms, 109 MB; SNUG no data, 2 h, 2.2 ms, 19 MB."
)


def _average_motions(run: Run, name: str) -> list[Table]:
    """Tabulate means over the sources of motion of each garment.

    Ablations, which stand beside their base, and perturbed references are left out; one of the latter is
    the floor of vertex-wise curvature.
    """
    title = name.replace("_", " ").capitalize()
    sources = "timed motions" if name == "cost" else "sources of motion"
    metrics, lines = pivot(run, run.garment_rows, name, ("garment", "method"))
    twins = run.twins - (set(SECOND_STARTS[:1]) if name == "curvature" else set())
    omissions = {
        garment: run.find_ablations(rows) | twins
        for garment, rows in run.garment_rows[run.garment_rows["table"] == name].groupby("garment")
    }
    return table(
        name, (GARMENT, METHOD, *map(metric_column, metrics)),
        [line for line in lines if line[1] not in omissions[line[0]]],
        f"{title}: means over {sources} and seeds.", grouped_by=("garment",),
        note=PAPER_COSTS if name == "cost" else "",
    )  # fmt: skip


def _average_seeds(run: Run, name: str) -> list[Table]:
    """Tabulate means over seeds in each scene."""
    metrics, lines = pivot(run, run.cells(), name, ("suite", "scene", "method"))
    columns = (SUITE, SCENE, METHOD, *map(metric_column, metrics))
    caption = f"{name.replace('_', ' ').capitalize()}, scene by scene."
    return table(f"{name}_by_scene", columns, lines, caption, grouped_by=("suite", "scene"))


def pivot(
    run: Run, frame: pd.DataFrame, name: str, keys: tuple[str, ...]
) -> tuple[list[Metric], list[Cells]]:
    """Compute means of the frame, a line for each value of the keys, a column for each metric.

    frame: rows of the run; those that failed say what a mean lacks. name: of the table that the metrics
    declare. keys: columns of results.csv that name a line, the last of them "method".
    """
    table_rows = frame[frame["table"] == name]
    usable = set(table_rows[table_rows["usable"]]["metric"])
    metrics = [metric for metric in run.metrics.values() if metric.name in usable]
    if not metrics:
        return [], []
    cells = means(frame[frame["metric"].isin(usable) | ~frame["usable"]], *keys, "metric")
    wide = cells.unstack("metric", sort=False).astype(object)
    wide = wide.where(wide.notna(), None)[[metric.name for metric in metrics]]
    methods = {method: k for k, method in enumerate(run.order(wide.index.get_level_values(-1)))}
    garments = {garment: k for k, garment in enumerate(run.garments(table_rows))}
    outer = {key[:-1]: k for k, key in reversed(list(enumerate(wide.index)))}
    last = len(keys) - 1

    def order(line: Cells) -> tuple[int, int, int]:
        """Garments as declared, other outer keys as they come, methods in their order."""
        garment = garments[str(line[0])] if keys[0] == "garment" else 0
        return garment, outer[line[:last]], methods[str(line[last])]

    lines = ((*key, *line) for key, line in zip(wide.index, wide.itertuples(index=False)))
    return metrics, sorted(lines, key=order)


# A term left out is larger, of course; the total is the base's own loss, curvature is nobody's.
COMPARED = ("energy/total", "curvature/histogram", "penetration/vertices", "roll_out/drift")


def ablation_effects(run: Run) -> list[Table]:
    """Tabulate the effect of each ablation against its base, with intervals."""
    metrics = [run.metrics[name] for name in COMPARED if name in run.metrics]
    lines: list[Cells] = []
    for garment in run.garments(run.garment_rows):
        rows = run.select_garment(garment)
        for method in run.order(run.find_ablations(rows) & set(rows[rows["usable"]]["method"])):
            base = run.methods[method].base
            effects = [compare_methods(run, rows, metric, method, base).effect for metric in metrics]
            lines.append((garment, method, *effects))
    caption = (
        "Effect of each variant, over the scenes that it shares with its base. ×: variant over base, of "
        "geometric means. Numbers without × are variant minus base, in the unit of the column; of relative "
        "excess, in points."
    )
    note = "Below: 95 % intervals over motions and seeds; of points with the mean nearer to 0 held."
    heads = [measure_of(metric) for metric in metrics]
    columns = (GARMENT, METHOD, *map(metric_column, heads))
    return table("ablation_effects", columns, lines, caption, grouped_by=("garment",), note=note)


METRICS = (TOTAL, "energy/strain", "energy/collision", "penetration/vertices")
SHAPE = "body/shape"  # norm of the parameters of a shape
OTHERS, MEAN_BODY = "other shapes", "mean shape"


def shapes(run: Run) -> list[Table]:
    """Tabulate each method on all other bodies together and on the mean body."""
    cells = run.cells("shapes")
    shape_rows = cells[(cells["metric"] == SHAPE) & cells["usable"]]
    norms = shape_rows.drop_duplicates("scene").set_index("scene")["value"]
    rows = cells[cells["scene"].isin(norms.index)]
    metrics = [run.metrics[name] for name in METRICS if name in run.metrics]
    if norms.nunique() < 2 or not metrics:
        return []
    methods = run.order(set(rows["method"]) - run.twins)
    lines: list[Cells] = []
    for name, bodies in ((OTHERS, norms > 0.0), (MEAN_BODY, norms == 0.0)):
        if not bodies.any():
            continue
        part = rows[rows["scene"].isin(norms.index[bodies])]
        all_means = means(part, "method", "metric")
        for method in methods:
            excess = None if method in (run.reference, SKINNING) else excess_of(run, part, method)
            share = excess.effect if excess else None
            lines.append((name, method, share, *(all_means.get((method, m.name)) for m in metrics)))
    columns = (
        Column("scene", "Body", text=True), METHOD, Column("typical", "Typical", "%", digits=2),
        *map(metric_column, metrics),
    )  # fmt: skip
    mean_body = ", and the mean body" * bool((norms == 0.0).any())
    caption = (
        f"Body shapes: the others together{mean_body}, in one motion. Typical (geometric, with its interval "
        "over bodies and seeds): relative excess; energies and penetration: means."
    )
    return table("shapes", columns, lines, caption)
