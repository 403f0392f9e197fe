"""Tables of what was found: the paper's claims, relative excess, errors in spreads of the reference."""

from __future__ import annotations

from benchmarks.metric import Metric
from reports.run.finished_run import Run
from reports.statistics.paper_claims import judged
from reports.statistics.relative_excess import SKINNING, Excess, excess_of, with_relative_excess
from reports.statistics.spreads import AT_REFERENCE, in_spreads
from reports.statistics.verdicts import measure_of, standing, untested
from reports.tables.table import GARMENT, METHOD, Cell, Column, Table, table

CLAIMS_NOTE = (
    "Effect: × the first over the second, of geometric means over motions and seeds; of energies whose zero "
    "is a choice, points of relative excess between the two; of frames, the first's share less half. Below "
    "it the 95 % interval over motions and seeds, of costs the range; of points it is the interval on the "
    "scale of the test, with the mean nearer to 0 held. p: of a primary claim by Holm for "
    "the whole primary family, of an exploratory one as it is. Tie: all of the interval lies within 5 % "
    "of equality, or within the spread of the reference's ensemble if that is wider. A claim holds, or does "
    "not hold, where p is below 0.05 and the difference exceeds that spread; a cost, where its range lies on "
    "one side. Inconclusive: anything else, fewer than four motions, a network of one seed, or a time "
    "without a range."
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
        Column("first", "Of the first", mixed=True),
        Column("second", "Of the second", mixed=True),
        Column("effect", "Effect", mixed=True),
        Column("p", "p", digits=2, mixed=True),
        Column("verdict", "Here", text=True),
    )
    rows: list[tuple[Cell, ...]] = [
        (
            line.claim.says, "primary" if line.claim.primary else "exploratory",
            measure_of(line.compared).heading, line.claim.lower, line.claim.relation, line.claim.higher,
            line.compared.one, line.compared.other, line.compared.effect, line.p,
            line.verdict + line.remark,
        )
        for line in judged(run)
    ]  # fmt: skip
    caption = "Claims of the paper, and whether they hold here."
    return table("findings", columns, rows, caption, grouped_by=("claim",), note=CLAIMS_NOTE)


EXCESS_NOTE = (
    "Typical: mean over motions and seeds of arcsinh(x / 1 %), taken back: a geometric mean well above 1 %, "
    "arithmetic well below; under it the 95 % interval. Segments of a recording count as one motion. Mean: "
    "arithmetic. Uncertain by: the spread over the reference's ensemble. Energy against the reference: more "
    "or less where p < 0.05 and the difference exceeds that spread."
)


def relative_excess(run: Run) -> list[Table]:
    """Tabulate the relative excess of each method over the motions of a garment."""
    lines: list[tuple[Cell, ...]] = []
    for garment, method, excess in _measured(run):
        worst, most = excess.worst
        stands = standing(excess.effect, excess.effect.p_value()) + untested(excess.effect)
        lines.append((
            garment, method, excess.effect, excess.typical_of(recorded=True),
            excess.typical_of(recorded=False), excess.pooled, excess.mean, most,
            worst.partition("/")[2] or worst, excess.uncertainty or None, len(excess.by_motion), stands,
        ))  # fmt: skip
    columns = (
        GARMENT, METHOD, Column("typical", "Typical", "%", digits=2),
        Column("recorded", "Recorded", "%", digits=2), Column("others", "Others", "%", digits=2),
        Column("pooled", "Pooled", "%", digits=2), Column("mean", "Mean", "%", digits=2),
        Column("worst", "Worst", "%", digits=2), Column("worst_motion", "Worst motion", text=True),
        Column("uncertain_by", "Uncertain by", "%"), Column("motions", "Motions"),
        Column("verdict", "Energy against the reference", text=True),
    )  # fmt: skip
    caption = (
        "Relative excess, (E - E_reference) / (E_skinning - E_reference) of the total energy E. Typical "
        "(geometric, with its interval) and mean: over independent sources and seeds. Recorded, others: "
        "typical of the library's recordings, and of other motions. Pooled: ratio of the sums over motions."
    )
    return table("relative_excess", columns, lines, caption, grouped_by=("garment",), note=EXCESS_NOTE)


def _measured(run: Run) -> list[tuple[str, str, Excess]]:
    """Return (garment, method, excess) of each method but skinning, the reference and its variants."""
    excesses = []
    for garment in run.garments(run.garment_rows):
        rows = with_relative_excess(run, run.garment_rows[run.garment_rows["garment"] == garment])
        zero = {*run.with_role("reference", "reference-variant"), SKINNING}
        for method in run.ordered(set(rows[rows["usable"]]["method"]) - zero):
            if excess := excess_of(run, rows, method):
                excesses.append((garment, method, excess))
    return excesses


def _error_title(metric: Metric) -> str:
    """Return the title of the error in a metric; of an amplitude it is not the amplitude."""
    measures_error = metric.name.startswith(("distance/", "curvature/"))
    return metric.title if measures_error else f"Error of {metric.title[:1].lower()}{metric.title[1:]}"


def errors_in_spreads(run: Run) -> list[Table]:
    """Tabulate distances, curvature errors and dynamics in spreads of the reference's ensemble."""
    metrics = [run.metrics[name] for name in AT_REFERENCE if name in run.metrics]
    variants = set(run.with_role("reference", "reference-variant"))
    lines: list[tuple[Cell, ...]] = []
    for garment in run.garments(run.garment_rows):
        rows = run.garment_rows[run.garment_rows["garment"] == garment]
        for method in run.ordered(set(rows[rows["usable"]]["method"]) - variants):
            values = [in_spreads(run, rows, method, metric.name) for metric in metrics]
            if any(value is not None for value in values):
                lines.append((garment, method, *values))
    columns = (GARMENT, METHOD, *(Column(metric.name, _error_title(metric)) for metric in metrics))
    caption = (
        "Each number is an error against the reference, root mean square over seeds, divided by the same "
        "error of the equally valid simulations; both are means over motions. 1 means: as near as another "
        "valid simulation."
    )
    return table("errors_in_spreads", columns, lines, caption, grouped_by=("garment",))
