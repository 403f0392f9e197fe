"""Tables beside the plot of error against run time: rivals of SNUG, and how certain the reference is."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import value_of
from reports.statistics.pareto import (
    NETWORK,
    SMALLER_STEPS,
    beaten_by,
    compared_scenes,
    fastest,
    indistinct,
    points_of,
    reference_scenes,
    truncated,
)
from reports.statistics.relative_excess import excess_of
from reports.tables.table import Cell, Column, Table, metric_column, table

RIVAL_ERRORS = ("gap/energy", "curvature/error")
UNCERTAIN = ("curvature/error", "distance/rms")
OF_STEPS = ("energy/strain", "dynamics/amplitude")  # what the time step changes


def error_rivals(run: Run) -> list[Table]:
    """Tabulate, for each error, the best method no slower than SNUG and the fastest solver as accurate."""
    frame = run.cells("speed", "garments")
    scenes = next(iter(compared_scenes(run, frame).values()), [])
    lines: list[tuple[Cell, ...]] = []
    for metric in RIVAL_ERRORS:
        points = points_of(run, frame, scenes, metric) if metric in run.metrics else []
        network = next((p for p in points if p.method == NETWORK), None)
        if network is None:
            continue
        best, solver = beaten_by(points, network), fastest(truncated(run, points), network.error)
        no_slower = (best.method, best.error, best.time) if best else ("", None, None)
        as_accurate = (solver.method, solver.time) if solver else ("", None)
        lines.append((run.metrics[metric].heading, network.error, network.time, *no_slower, *as_accurate))
    columns = (
        Column("error", "Error", text=True),
        Column("network", "Of SNUG", mixed=True),
        Column("network_time", "Run time of SNUG", "ms"),
        Column("no_slower", "Best that is no slower", text=True, method=True),
        Column("no_slower_error", "Its error", mixed=True),
        Column("no_slower_time", "Its run time", "ms"),
        Column("as_accurate", "Fastest solver as accurate", text=True, method=True),
        Column("as_accurate_time", "Its run time", "ms"),
    )
    caption = (
        f"SNUG and its rivals in {', '.join(scenes)}: the best method not slower beyond repeats, "
        "and the fastest solver stopped early, without a network, that is as accurate. A dash: none."
    )
    return table("error_rivals", columns, lines, caption)


def reference_uncertainty(run: Run) -> list[Table]:
    """Tabulate how far equally valid references, and smaller time steps, lie from the reference.

    There is no table where a run has neither.
    """
    frame = run.cells("speed", "garments")
    scenes = reference_scenes(run)
    rows = frame[frame["scene"].isin(scenes)]
    metrics = [run.metrics[name] for name in (*OF_STEPS, *UNCERTAIN) if name in run.metrics]
    ensemble = [
        None if metric.name in OF_STEPS else indistinct(run, rows, metric.name) or None for metric in metrics
    ]
    lines: list[tuple[Cell, ...]] = [
        ("ensemble of the reference, root mean square", *[None] * len(scenes), *ensemble)
    ]
    steps = [m for m in run.methods.values() if m.family == SMALLER_STEPS and m.level]
    if not (steps or any(value is not None for value in ensemble)):
        return []
    labels = {m.name: f"{m.level:g} steps a frame" for m in sorted(steps, key=lambda m: m.level or 0.0)}
    labels |= {name: run.label(name) for name in (run.reference, NETWORK, "pbns")}
    for name, label in labels.items():
        excess = excess_of(run, rows, name)
        values = (value_of(rows, name, metric.name) for metric in metrics)
        shares = excess.by_motion if excess else {}
        lines.append((label, *map(shares.get, scenes), *values))
    lines = [line for line in lines if any(value is not None for value in line[1:])]
    of_scenes = [
        Column(f"excess_{scene}", f"Relative excess, {scene.partition('/')[2]}", "%", digits=2)
        for scene in scenes
    ]
    columns = (Column("of", "Simulation or network", text=True), *of_scenes, *map(metric_column, metrics))
    caption = (
        f"Reference, simulations with smaller time steps, and networks in {', '.join(scenes)}. Errors below "
        "the ensemble's are as small as those of another valid simulation."
    )
    return table("reference_uncertainty", columns, lines, caption)
