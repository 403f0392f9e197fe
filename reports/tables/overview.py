"""The methods of page one and their numbers: few rows, few columns, the rest is in the other tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pandas as pd

from reports.figures.break_even import NETWORK, compared_scenes, rivals
from reports.run.rows import Run
from reports.statistics.means import mean_of, shared_scenes
from reports.statistics.pareto import run_time
from reports.tables.table import Cell, Column, Table, metric_column, table

ROWS = 8
WORN = ("energy/total", "energy/strain", "curvature/error", "penetration/vertices")
STEPS = ("gap/energy", "step/distance")
LEARNED = ("network", "ablation")
BEST_BY = ("step/distance", "gap/energy", "curvature/error", "energy/total")


def leads(
    run: Run, rows: pd.DataFrame, among: Iterable[str] | None = None, by: Sequence[str] = BEST_BY
) -> list[str]:
    """The reference, the network, the best of other networks in these rows, and the first baseline; of those
    in `among` alone where that is given. Changed networks are networks where a run has no others. The best
    has the lowest of the first metric of `by` that any of them has.
    """
    usable = set(rows[rows["usable"]]["method"])
    have = usable if among is None else usable & set(among)
    learned = [name for name in run.with_role(*LEARNED) if name in have]
    others = [name for name in learned if not run.methods[name].base] or learned
    own = NETWORK if NETWORK in others else next(iter(others), "")
    best = _best(rows, [name for name in others if name != own], by)
    baseline = next((name for name in run.with_role("baseline") if name in have), "")
    return [name for name in (run.reference, own, best, baseline) if name in have]


def _best(rows: pd.DataFrame, names: Sequence[str], by: Sequence[str]) -> str:
    """Over the scenes that those of them share that came through most of them."""
    for metric in by:
        found = {name: mean for name in names if (mean := mean_of(rows, name, metric)) is not None}
        most = max((len(mean.cells) for mean in found.values()), default=0)
        whole = [name for name, mean in found.items() if len(mean.cells) == most]
        scenes = shared_scenes(rows, whole, metric)
        means = {name: mean for name in whole if (mean := mean_of(rows, name, metric, scenes)) is not None}
        if means:
            return min(means, key=lambda name: means[name].value)
    return next(iter(names), "")


def overview(run: Run) -> list[Table]:
    """Reference, baselines and networks of the first garment, and the fastest solvers as good as the network.

    Energies and curvature are means over its motions, what is said of steps and times is of the scenes in
    which solvers were timed.
    """
    worn = run.worn
    garment = next(iter(run.garments(worn)), None)
    worn = worn[worn["garment"] == garment]
    cells = run.cells("speed", "garments")
    scenes = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(scenes)] if scenes else worn
    worn = timed if worn.empty else worn  # of a run of suite speed alone
    plain = set(worn[worn["usable"]]["method"]) - run.standing_apart(worn)
    chosen = leads(run, worn)
    chosen += [
        m
        for m in run.ordered(plain)
        if m not in chosen and run.methods[m].role in ("network", "bound", "baseline")
    ]
    why = rivals(run, cells, scenes) if scenes else {}
    solvers = [m for m in why if m not in chosen]
    chosen = run.ordered([*chosen[: ROWS - len(solvers)], *solvers])
    wanted = [(name, worn) for name in WORN] + [(name, timed) for name in (*STEPS, run_time(timed))]
    wanted += [("cost/train", worn)]
    asked = [(run.metrics[name], rows) for name, rows in wanted if name in run.metrics]
    lines: list[tuple[Cell, ...]] = [
        (method, *(mean_of(rows, method, metric.name) for metric, rows in asked)) for method in chosen
    ]
    kept = [k for k in range(1, len(asked) + 1) if any(line[k] is not None for line in lines)]
    lines = [(line[0], *(line[k] for k in kept)) for line in lines]
    columns = [metric_column(asked[k - 1][0]) for k in kept]
    if not columns:
        return []
    caption = f"{garment}: means over its motions" if garment else f"Means over {', '.join(scenes)}"
    caption += f"; gaps, single steps and run times over {', '.join(scenes)}." if garment and scenes else "."
    method = Column("method", "Method", text=True, method=True)
    return table("overview", (method, *columns), lines, caption)
