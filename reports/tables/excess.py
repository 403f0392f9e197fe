"""Tables of the primary measure, relative excess: by method with interval, and by motion."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.relative_excess import Excess, excess_of
from reports.statistics.verdicts import standing
from reports.tables.table import GARMENT, METHOD, SCENE, Cell, Column, Table, table

NOTE = (
    "Typical: the mean over motions and seeds on a scale that is logarithmic above 1 % of skinning's excess "
    "and linear below, taken back; below it the 95 % interval. Mean and worst are of motions. Left out: "
    "smallest and largest typical value without any one motion. Uncertain by: the spread over the "
    "reference's ensemble."
)


def relative_excess(run: Run) -> list[Table]:
    """Tabulate the relative excess of each method over the motions of a garment."""
    lines: list[tuple[Cell, ...]] = []
    for garment, method, excess in _measured(run):
        low, high = excess.without_each_motion
        worst, most = excess.worst
        stands = standing(excess.effect, excess.effect.p_value())
        lines.append((
            garment, method, excess.effect, excess.mean, most, worst.partition("/")[2] or worst, low, high,
            excess.uncertainty or None, len(excess.by_motion), stands,
        ))  # fmt: skip
    columns = (
        GARMENT, METHOD, Column("typical", "Typical", "%"), Column("mean", "Mean", "%"),
        Column("worst", "Worst", "%"), Column("worst_motion", "Worst motion", text=True),
        Column("left_out_low", "Left out, low", "%"), Column("left_out_high", "Left out, high", "%"),
        Column("uncertain_by", "Uncertain by", "%"), Column("motions", "Motions"),
        Column("verdict", "Beside the reference", text=True),
    )  # fmt: skip
    caption = "Relative excess: share of skinning's excess energy over the reference that a method leaves."
    return table("relative_excess", columns, lines, caption, grouped_by=("garment",), note=NOTE)


def relative_excess_by_motion(run: Run) -> list[Table]:
    """Tabulate the relative excess of each method in each motion, the mean over seeds."""
    lines: list[tuple[Cell, ...]] = [
        (scene, method, share)
        for _, method, excess in _measured(run)
        for scene, share in excess.by_motion.items()
    ]
    lines = sorted(lines, key=lambda line: list(dict.fromkeys(line[0] for line in lines)).index(line[0]))
    columns = (SCENE, METHOD, Column("relative_excess", "Relative excess", "%"))
    caption = "Relative excess by motion, mean over seeds."
    return table("relative_excess_by_motion", columns, lines, caption, grouped_by=("scene",))


def _measured(run: Run) -> list[tuple[str, str, Excess]]:
    """Return (garment, method, excess) of each method but skinning, the reference and its variants."""
    found = []
    for garment in run.garments(run.garment_rows):
        rows = run.garment_rows[run.garment_rows["garment"] == garment]
        zero = {*run.with_role("reference", "reference-variant"), *run.with_role("baseline")[:1]}
        for method in run.ordered(set(rows[rows["usable"]]["method"]) - zero):
            if excess := excess_of(run, rows, method):
                found.append((garment, method, excess))
    return found
