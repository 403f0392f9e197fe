"""The table of page one: few methods and few numbers, and rivals of SNUG."""

from __future__ import annotations

from collections.abc import Sequence

from reports.finished_run import Run
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.outcomes import EXTERNAL, leads
from reports.statistics.pareto import rivals, run_time, select_timed
from reports.statistics.relative_excess import SKINNING, add_excess, excess_of, own_excess_of
from reports.tables.table import METHOD, Cell, Cells, Column, Table, metric_column, say_where, table

ROWS = 8
ANSWERS = ("penetration/surface", "dynamics/correlation", "dynamics/amplitude")
GAP = "gap/energy"


def overview(run: Run, methods: Sequence[str] = ()) -> list[Table]:
    """Tabulate methods on the first garment, and the solvers as good as SNUG.

    methods: rows in place of these.

    Relative excess, penetration and dynamics are means over its sources of motion, energy gaps and times
    over the scenes in which solvers were timed.
    """
    garment = run.first_garment
    garment_rows = run.select_garment(garment)
    timed, scenes = select_timed(run, garment_rows)
    garment_rows = timed if garment_rows.empty else garment_rows  # of a run of suite speed alone
    plain = set(garment_rows[garment_rows["usable"]]["method"]) - run.find_ablations(garment_rows)
    listed = leads(run, garment_rows)
    roles = ("network", EXTERNAL, "baseline")
    others = [m for role in roles for m in run.order(plain) if run.methods[m].role == role]
    # Of a family of networks the last one: that of the highest level.
    last = {run.methods[m].family: m for m in others}
    listed += [m for m in last.values() if m not in listed]
    best = rivals(run, timed) if scenes else []
    solvers = [m for m in best if m not in listed]
    listed = run.order(methods or [*listed[: ROWS - len(solvers)], *solvers])
    queries = [(name, garment_rows) for name in ANSWERS] + [(GAP, timed), (run_time(timed), timed)]
    queries += [("cost/train", garment_rows)]
    sources = [(run.metrics[name], rows) for name, rows in queries if name in run.metrics]
    with_excess = add_excess(run, garment_rows)
    excesses = {name: excess_of(run, with_excess, name) for name in listed if name != run.reference}
    own_excess = {m: own_excess_of(run, garment_rows, m) for m in excesses if m != SKINNING}
    shares: dict[str, tuple[Cell, Cell]] = {
        m: (own_excess.get(m, share.effect), share.effect) for m, share in excesses.items() if share
    }
    shares |= {run.reference: (0.0, 0.0)} if shares else {}
    lines: list[Cells] = [
        (
            method, *shares.get(method, (None, None)),
            *(mean_of(rows, method, metric.name) for metric, rows in sources),
        )
        for method in listed
    ]  # fmt: skip
    columns = [
        METHOD, Column("own_excess", "Excess in own energies", "%", digits=2),
        Column("relative_excess", "Relative excess", "%", digits=2),
        *(metric_column(metric) for metric, _ in sources),
    ]  # fmt: skip
    of_motions = (
        f"{garment}: means over independent sources of motion, of excess geometric. In own energies: over "
        "the minimum of what the network was trained on (a dash: of vertices, or without a minimum)"
    )
    caption = of_motions if garment else f"Means {say_where(scenes)}"
    caption += f"; run times (and energy gaps) {say_where(scenes)}." if garment and scenes else "."
    tables = [part.drop_empty() for part in table("overview", columns, lines, caption)]
    return [part for part in tables if part.columns != (METHOD,)]
