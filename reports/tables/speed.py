"""Tables on run time: break-even of trainings, rivals, the reference's uncertainty."""

from __future__ import annotations

import itertools

from reports.run.finished_run import Run
from reports.statistics.break_even import (
    NETWORK,
    compared_costs,
    compared_scenes,
    crossing,
    reference_scenes,
    rivals,
)
from reports.statistics.means_and_spreads import value_of
from reports.statistics.pareto import (
    SMALLER_STEPS,
    beaten_by,
    fastest,
    indistinct,
    points_of,
    truncated,
)
from reports.statistics.relative_excess import excess_of
from reports.tables.table import GARMENT, Cell, Column, Table, metric_column, table

RIVAL_ERRORS = ("gap/energy", "curvature/error")
UNCERTAIN = ("curvature/error", "distance/rms")
OF_STEPS = ("energy/strain", "dynamics/amplitude")  # what the time step changes


def crossings(run: Run) -> list[Table]:
    """Tabulate from how many frames on each trained network is cheaper than its rival solvers."""
    frame = run.cells("speed", "garments")
    lines: list[tuple[Cell, ...]] = []
    for garment, scenes in compared_scenes(run, frame).items():
        reasons = rivals(run, frame, scenes)
        for network, rival in itertools.product(*compared_costs(run, frame, scenes, reasons)):
            frames = crossing(network, rival)
            total = None if frames is None else network.total(frames)
            rounded = None if frames is None else float(f"{frames:.1e}")
            times = rival.frame / network.frame if network.frame else None
            names = (garment, network.method, rival.method, reasons[rival.method])
            lines.append((*names, rounded, total, network.before, times))
    columns = (
        GARMENT,
        Column("method", "Network", text=True, method=True),
        Column("solver", "Overtakes", text=True, method=True),
        Column("as_good", "As good by", text=True),
        Column("crossing", "From frames on", digits=2, trim=True),
        Column("total_time", "Total time by then", "s"),
        Column("before", "Network's before its first frame", "s"),
        Column("frame_ratio", "Its run time over the network's", digits=2),
    )
    caption = (
        "From how many frames on training pays, against the converged simulation and the fastest solvers "
    )
    caption += "as good as SNUG; a dash: never."
    return table("crossings", columns, lines, caption, grouped_by=("garment",))


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
