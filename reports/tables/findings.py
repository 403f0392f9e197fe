"""Tables of what was found: the paper's claims, relative excess, outcomes, what did not end well."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import STARTS
from reports.finished_run import Run
from reports.statistics.effects import EXCESS, unscale
from reports.statistics.means_and_spreads import AT_REFERENCE, count_spreads
from reports.statistics.outcomes import checks, stress_tests, tolerances_away
from reports.statistics.paper_claims import judge_claims
from reports.statistics.relative_excess import (
    LEAST,
    SKINNING,
    Excess,
    add_excess,
    excess_of,
    own_excess_of,
)
from reports.statistics.verdicts import OPEN, decide, explain, measure_of
from reports.tables.table import GARMENT, METHOD, SCENE, SUITE, Cells, Column, Table, name_scene, table

# The rule of verdicts (reports.statistics.verdicts) in a note.
VERDICTS = (
    "Tie: all of the interval within 5 % of equality, or the noise of the reference if that is wider, "
    "against each time step. Decided: p < 0.05, beyond that noise, with one sign against each time step."
)
CLAIMS_NOTE = (
    "Effect: × the first over the second, of geometric means; of energies whose zero is a choice, points of "
    "relative excess between the two; of frames, the first's share less half. Below: the 95 % interval over "
    "motions and seeds (of points with the mean nearer to 0 held), of costs the range. p: of primary claims "
    f"by Holm for the whole family. {VERDICTS} Costs are decided where their range lies on one side."
)


def findings(run: Run) -> list[Table]:
    """List the claims that this run can judge, over scenes of the first garment that both methods share."""
    columns = (
        Column("claim", "Claim", text=True),
        Column("family", "Family", text=True),
        Column("metric", "Measure", text=True),
        Column("lower", "First", text=True, method=True),
        Column("claimed", "Claim", text=True),
        Column("higher", "Second", text=True, method=True),
        Column("first", "Of the first"),
        Column("second", "Of the second"),
        Column("effect", "Effect"),
        Column("p", "p", digits=2),
        Column("verdict", "Here", text=True),
    )
    rows: list[Cells] = [
        (
            line.claim.says, "primary" if line.claim.primary else "exploratory",
            measure_of(line.compared.metric).heading,
            line.claim.lower, line.claim.relation, line.claim.higher,
            line.compared.one, line.compared.other, line.compared.effect, line.p,
            line.verdict + line.remark,
        )
        for line in judge_claims(run)
    ]  # fmt: skip
    caption = "Claims of the paper, and whether they hold here."
    return table("findings", columns, rows, caption, grouped_by=("claim",), note=CLAIMS_NOTE)


EXCESS_NOTE = (
    "Typical: sinh of the mean of arcsinh(x / 1 %) over sources and seeds; a recording's segments are one. "
    f"A garment below {LEAST:g} % has fallen off and counts as failed. {VERDICTS}"
)


def relative_excess(run: Run) -> list[Table]:
    """Tabulate the relative excess of each method over the motions of a garment, and by time step."""
    zero = {*run.with_role("reference", "reference-variant"), SKINNING}
    excesses: dict[tuple[str, str], Excess] = {}
    lines: list[Cells] = []
    for garment in run.garments(run.garment_rows):
        rows = add_excess(run, run.select_garment(garment))
        for method in run.order(set(rows[rows["usable"]]["method"]) - zero):
            if excess := excess_of(run, rows, method):
                excesses[garment, method] = excess
                lines.append((garment, method, own_excess_of(run, rows, method), *_cells_of(excess)))
    shares = ("typical", "recorded", "others", "pooled", "worst")
    columns = (
        GARMENT, METHOD, Column("own", "In own energies", "%", digits=2),
        *(Column(name, name.capitalize(), "%", digits=2) for name in shares),
        Column("worst_motion", "Worst motion", text=True),
        Column("motions", "Motions"), Column("verdict", "Energy against the reference", text=True),
    )  # fmt: skip
    caption = (
        "Relative excess, (E - E_reference) / (E_skinning - E_reference) of the total energy E. Recorded, "
        "others: typical of the library's recordings, of other motions. Pooled: ratio of sums over motions."
    )
    means = table("relative_excess", columns, lines, caption, grouped_by=("garment",), note=EXCESS_NOTE)
    return [*means, *_tabulate_steps(run, excesses)]


def _tabulate_steps(run: Run, excesses: Mapping[tuple[str, str], Excess]) -> list[Table]:
    """Tabulate typical relative excesses by garment and method against each smaller time step."""
    members = [name for name in run.reference_family if name not in STARTS[1]]
    lines: list[Cells] = []
    for key, excess in excesses.items():
        value, against = excess.effect.value, excess.effect.against
        moved = {name: float(unscale(value + change, EXCESS)) for name, change in against.items()}
        if moved:
            lines.append((*key, excess.typical, *map(moved.get, members)))
    columns = (
        GARMENT, METHOD,
        *(Column(name, run.label(name), "%", digits=2) for name in (run.reference, *members)),
    )  # fmt: skip
    caption = (
        "Typical relative excess against each simulation in the reference's place; changes are those in "
        "motions in which all converged. Below zero: less energy than that."
    )
    return table("excess_by_time_step", columns, lines, caption, grouped_by=("garment",))


def _cells_of(excess: Excess) -> Cells:
    """Return the cells of a method in table relative_excess."""
    scene, value = excess.worst
    verdict = decide(excess.effect, excess.effect.p_value())
    verdict += explain(excess.effect) if verdict == OPEN else ""
    return (
        excess.effect, excess.typical_of(recorded=True), excess.typical_of(recorded=False), excess.pooled,
        value, name_scene(scene.partition("/")[2] or scene), len(excess.by_motion), verdict,
    )  # fmt: skip


def _error_title(metric: Metric) -> str:
    """Return the title of the error in a metric; of an amplitude it is not the amplitude."""
    measures_error = metric.name.startswith(("distance/", "curvature/"))
    return metric.title if measures_error else f"Error of {metric.title[:1].lower()}{metric.title[1:]}"


def errors_in_spreads(run: Run) -> list[Table]:
    """Tabulate distances, curvature and dynamics in errors of the reference's other start."""
    metrics = [run.metrics[name] for name in AT_REFERENCE if name in run.metrics]
    variants = set(run.with_role("reference", "reference-variant"))
    lines: list[Cells] = []
    for garment in run.garments(run.garment_rows):
        rows = run.select_garment(garment)
        for method in run.order(set(rows[rows["usable"]]["method"]) - variants):
            values = [count_spreads(run, rows, method, metric.name) for metric in metrics]
            if any(value is not None for value in values):
                lines.append((garment, method, *values))
    columns = (GARMENT, METHOD, *(Column(metric.name, _error_title(metric)) for metric in metrics))
    caption = (
        "Each number is an error against the reference (of correlation: 1 - correlation), root mean square "
        "over seeds, divided by that of the same simulation started 0.1 mm apart; both are means over the "
        "motions in which that converged. 1 means: as near as that."
    )
    return table("errors_in_spreads", columns, lines, caption, grouped_by=("garment",))


def validation(run: Run) -> list[Table]:
    """List the checks: measured against expected; one without a tolerance is reported, not judged.

    A row that is ok outside its tolerance is of a program under test, which violates what is expected.
    """
    lines = [
        (
            row.case or f"{row.scene}: {run.metrics[row.metric].title}",
            row.unit,
            row.value,
            row.expected,
            row.tolerance,
            tolerances_away(row),
            _result(row),
        )
        for row in checks(run).itertuples()
    ]
    columns = (
        Column("check", "Check", text=True),
        Column("unit", "Unit", text=True),
        Column("measured", "Measured", digits=7, trim=True),
        Column("expected", "Expected", digits=7, trim=True),
        Column("tolerance", "Tolerance", digits=2, trim=True),
        Column("away", "Tolerances away", digits=2),
        Column("status", "Result", text=True),
    )
    return table("validation", columns, lines, "Checks with a known answer.")


def _result(row: Any) -> str:
    if row.status != "ok":
        return row.status
    if pd.isna(row.tolerance):
        return "reported"
    return "pass" if (tolerances_away(row) or 0.0) <= 1.0 else "violated"


def extremes(run: Run) -> list[Table]:
    """List the stress tests and how each ended."""
    rows = stress_tests(run)
    lines = [(r.scene, r.method, "converged" if r.status == "ok" else r.status, r.value, r.reason)
        for r in rows.itertuples()]  # fmt: skip
    unit = rows["unit"].iloc[0] if len(rows) else ""
    columns = (
        Column("case", "Case", text=True),
        METHOD,
        Column("outcome", "Outcome", text=True),
        Column("gradient", "Largest gradient", unit, digits=2, trim=True),
        Column("reason", "In words", text=True),
    )
    return table("extremes", columns, lines, "Every stress test and how it ended.")


def list_unfinished(run: Run) -> list[Table]:
    """List every cell that failed or was skipped, once per reason, not per metric."""
    judged_elsewhere = (run.frame["case"] != "") & (run.frame["status"] != "skipped")
    rows = run.frame[(run.frame["status"] != "ok") & ~judged_elsewhere]
    names = ["suite", "scene", "method", "seed", "status", "reason"]
    lines = rows[names].drop_duplicates().itertuples(index=False)
    columns = (SUITE, SCENE, METHOD,
        Column("seed", "Seed", text=True), Column("status", "Status", text=True),
        Column("reason", "Reason", text=True))  # fmt: skip
    cells = [(*line[:5], line[5] or "no reason given") for line in lines]
    caption = "Cells that failed or were skipped, with the reason of each."
    return table("unfinished", columns, cells, caption)
