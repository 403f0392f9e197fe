"""Table of the paper's claims and whether they hold here."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.paper_claims import judged
from reports.statistics.verdicts import measure_of
from reports.tables.table import Cell, Column, Table, table

NOTE = (
    "Effect: × the first over the second, of geometric means over motions and seeds; of energies whose zero "
    "is a choice, points of skinning's excess between the two; of frames, the first's share less half. Below "
    "it the 95 % interval over motions and seeds, of costs the range. p: of a primary claim by Holm for "
    "the whole primary family, of an exploratory one as it is. Tie: all of the interval lies within 5 % "
    "of equality, or within the spread of the reference's ensemble if that is wider. A claim holds, or does "
    "not hold, where p is below 0.05 and the difference exceeds that spread; a cost, where its range lies on "
    "one side. Inconclusive: anything else, fewer than four motions, or a network of one seed."
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
    return table("findings", columns, rows, caption, grouped_by=("claim",), note=NOTE)
