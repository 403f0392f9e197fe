"""Table of page one: few methods, few numbers; the rest is in the other tables."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.break_even import compared_scenes, rivals
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.page_one_methods import leads
from reports.statistics.pareto import run_time
from reports.tables.table import Cell, Column, Table, metric_column, table

ROWS = 8
ENERGIES = ("energy/total", "energy/strain", "curvature/error", "penetration/vertices")
STEPS = ("gap/energy", "step/distance")


def overview(run: Run) -> list[Table]:
    """Tabulate reference, baselines and networks of the first garment, and the solvers as good as SNUG.

    Energies and curvature are means over its motions, errors of steps and times over the scenes in which
    solvers were timed.
    """
    garment = run.first_garment
    rows_of_garment = run.garment_rows[run.garment_rows["garment"] == garment]
    cells = run.cells("speed", "garments")
    scenes = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(scenes)] if scenes else rows_of_garment
    rows_of_garment = timed if rows_of_garment.empty else rows_of_garment  # of a run of suite speed alone
    plain = set(rows_of_garment[rows_of_garment["usable"]]["method"]) - run.standing_apart(rows_of_garment)
    chosen = leads(run, rows_of_garment)
    chosen += [
        m
        for m in run.ordered(plain)
        if m not in chosen and run.methods[m].role in ("network", "bound", "baseline")
    ]
    why = rivals(run, cells, scenes) if scenes else {}
    solvers = [m for m in why if m not in chosen]
    chosen = run.ordered([*chosen[: ROWS - len(solvers)], *solvers])
    wanted = [(name, rows_of_garment) for name in ENERGIES] + [
        (name, timed) for name in (*STEPS, run_time(timed))
    ]
    wanted += [("cost/train", rows_of_garment)]
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
