"""Table of the paper's claims and whether they hold here."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.paper_claims import judged
from reports.tables.table import Cell, Column, Table, table

NOTE = (
    "Effect: × the first over the second, of geometric means over motions and seeds; the first less the "
    "second where a value is not positive or zero is a choice, as of gravity; of frames, the first's share "
    "less half. Below it the 95 % interval over motions and seeds, of the line by itself. p: corrected by "
    "Holm for all lines; a claim holds, or does not hold, where p is below .05. Tie: p is not, and all of "
    "the interval is within 5 % of equality; or the difference is within the uncertainty of the reference. "
    "Cannot be told: neither, or a network was trained with one seed. Where nothing was repeated, 5 % decide."
)


def findings(run: Run) -> list[Table]:
    """List the claims that this run can judge, over scenes of the first garment that both methods share."""
    columns = (
        Column("claim", "Claim", text=True),
        Column("metric", "Measure", text=True),
        Column("lower", "First", text=True, method=True),
        Column("claimed", "Claim", text=True),
        Column("higher", "Second", text=True, method=True),
        Column("first", "Of the first", mixed=True),
        Column("second", "Of the second", mixed=True),
        Column("difference", "Difference", mixed=True),
        Column("effect", "Effect", mixed=True),
        Column("p", "p", digits=2, mixed=True),
        Column("verdict", "Here", text=True),
    )
    rows: list[tuple[Cell, ...]] = [
        (
            line.claim.says, line.metric.heading, line.claim.lower, line.claim.relation,
            line.claim.higher, line.one, line.other,
            None if line.one is None or line.other is None else line.one.value - line.other.value,
            line.effect, line.p, line.verdict + line.remark,
        )
        for line in judged(run)
    ]  # fmt: skip
    caption = "Claims of the paper, and whether they hold here."
    return table("findings", columns, rows, caption, grouped_by=("claim",), note=NOTE)
