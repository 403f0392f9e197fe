"""Tables on run time and training: break-even, rivals, the reference's uncertainty, how trainings ended."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from reports.run.finished_run import Run
from reports.run.stored_files import LAST, History
from reports.statistics.means_and_spreads import Mean, value_of
from reports.statistics.pareto import (
    NETWORK,
    SMALLER_STEPS,
    beaten_by,
    compared_costs,
    compared_scenes,
    crossing,
    fastest,
    indistinct,
    points_of,
    reference_scenes,
    rivals,
    truncated,
)
from reports.statistics.relative_excess import excess_of
from reports.tables.table import GARMENT, METHOD, Cell, Column, Table, metric_column, table

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


def trainings(run: Run) -> list[Table]:
    """Tabulate how long each network trained and how its loss ended; means over seeds."""
    groups: dict[tuple[str, str], list[History]] = {}
    for history in run.histories:
        groups.setdefault((history.garment, history.method), []).append(history)
    place = {method: k for k, method in enumerate(run.ordered({method for _, method in groups}))}
    lines: list[tuple[Cell, ...]] = []
    for (garment, method), histories in sorted(groups.items(), key=lambda item: place[item[0][1]]):
        ends = [
            (h.frames, h.rows[-1]["step"], h.best_step, h.rows[-1]["seconds"], h.last_loss, h.decrease)
            for h in histories
        ]
        lines.append((garment, method, len(histories), *map(_over_seeds, zip(*ends)), histories[0].unit))
    order = list(dict.fromkeys(history.garment for history in run.histories))
    lines.sort(key=lambda line: order.index(str(line[0])))
    columns = (
        GARMENT, METHOD,
        Column("seeds", "Seeds"), Column("frames", "Frames", digits=6, trim=True),
        Column("steps", "Steps", digits=6, trim=True),
        Column("best", "Best on held-out", digits=6, trim=True), Column("seconds", "Training", "s"),
        Column("loss", "Loss at its end", mixed=True), Column("decrease", "Fell in last fifth", "%"),
        Column("unit", "Unit of loss", text=True),
    )  # fmt: skip
    filled = [k for k in range(len(columns)) if any(line[k] is not None for line in lines)]
    lines = [tuple(line[k] for k in filled) for line in lines]
    caption = (
        f"How trainings ended. Losses are means of {LAST} logged ones. The fall is from the {LAST} before "
        "four fifths of the steps. Where the rate falls to zero, a loss levels off by itself."
    )
    return table("trainings", [columns[k] for k in filled], lines, caption, grouped_by=("garment",))


def _over_seeds(values: Sequence[float | None]) -> Mean | float | None:
    """Return mean and spread of the values; a number that no seed changes as it is."""
    known = {("", seed): x for seed, x in enumerate(values) if x is not None and np.isfinite(x)}
    numbers = np.array(list(known.values()), dtype=float)
    if len(numbers) == len(values) and len(set(known.values())) == 1:
        return float(numbers[0])
    spread = float(numbers.std(ddof=1)) if len(numbers) > 1 else None
    return Mean(float(numbers.mean()), spread, len(numbers), len(values), cells=known) if known else None
