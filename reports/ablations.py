"""SNUG less one ingredient at a time, beside the full recipe: what leaving it out makes worse, and better."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.results import Row
from reports.summary import TSHIRT, Mean, Measurements, scatter, suite_rows, wardrobe
from reports.table import Cell, Column, Table

FULL = "snug"
ROLL_OUTS = "roll-outs"  # suite of rows that belong to a network of the T-shirt, not to a scene of a garment
LONG, TRAINING = ("there_and_back",), ("training",)  # its scenes: a thousand frames, and the training motions
ABLATIONS = {
    "snug-no-bending": "without bending",
    "snug-no-strain": "without strain",
    "snug-no-gravity": "without gravity",
    "snug-no-inertia": "without inertia",
    "snug-no-noise": "without noise in the first state",
    "snug-window6": "with windows of 6",
    "snug-window12": "with windows of 12",
    "snug-springs": "with springs instead of StVK",
}
COLUMNS = {
    "energy/strain": Column("strain", "Strain", "J"),
    "energy/bending": Column("bending", "Bending", "J"),
    "energy/gravity": Column("gravity", "Gravity", "J"),
    "energy/inertia": Column("inertia", "Inertia", "J"),
    "energy/collision": Column("collision", "Collision", "J"),
    "energy/total": Column("total", "Total", "J"),
    "curvature/error": Column("error", "Curvature error", "1/m"),
    "penetration/vertices": Column("vertices", "Below skin", "%"),
    "roll_out/drift": Column("drift", "Drift", "mm"),
}
# A term that is left out of the loss is of course larger: these measures are nobody's own loss.
JUDGED = {
    "energy/total": "total energy",
    "curvature/error": "curvature error",
    "penetration/vertices": "vertices below the skin",
    "roll_out/drift": "drift of long roll-outs",
}
HEAD = (Column("garment", "Garment"), Column("method", "Method"))
CAPTIONS = {
    "ablations": "Ablations: full SNUG first, then less one ingredient each. Drift: after a thousand frames "
    "there and back, T-shirt alone.",
    "ablations_judged": "Where each ablation is worse than full SNUG, and where better, by more than the "
    "scatter of seeds.",
}


def ablations(rows: Sequence[Row]) -> Table | None:
    """The numbers of the full recipe and of each ablation that ran, by garment; None where none did."""
    lines: list[tuple[Cell, ...]] = [
        (garment, method, *(own[metric] for metric in COLUMNS))
        for garment, means in measured_ablations(rows).items()
        for method, own in means.items()
    ]
    return Table("ablations", (*HEAD, *COLUMNS.values()), tuple(lines)) if lines else None


def ablations_judged(rows: Sequence[Row]) -> Table | None:
    """In words, by garment: in which measures each ablation is worse or better than the full recipe."""
    lines: list[tuple[Cell, ...]] = [
        (garment, method, *(", ".join(found) for found in compared(means[FULL], own)))
        for garment, means in measured_ablations(rows).items()
        for method, own in means.items()
        if method != FULL
    ]
    columns = (*HEAD, Column("worse", "Worse in"), Column("better", "Better in"))
    return Table("ablations_judged", columns, tuple(lines)) if lines else None


def measured_ablations(rows: Sequence[Row]) -> dict[str, dict[str, dict[str, Mean | None]]]:
    """garment -> method -> metric -> mean, of garments on which the full recipe and some ablation ran."""
    measured = Measurements(suite_rows(rows, "garments"))
    found = {}
    for garment, scenes in wardrobe(measured).items():
        ran = [m for m in (FULL, *ABLATIONS) if measured.mean(m, "energy/total", scenes) is not None]
        if ran[:1] == [FULL] and len(ran) > 1:
            long = Measurements(suite_rows(rows, ROLL_OUTS) if garment == TSHIRT else ())
            found[garment] = {
                method: {
                    metric: long.mean(method, metric, LONG)
                    if metric.startswith("roll_out/")
                    else measured.mean(method, metric, scenes)
                    for metric in COLUMNS
                }
                for method in ran
            }
    return found


def compared(full: dict[str, Mean | None], own: dict[str, Mean | None]) -> tuple[list[str], list[str]]:
    """The measures in which an ablation is worse than the full recipe, and those in which it is better."""
    worse: list[str] = []
    better: list[str] = []
    for metric, words in JUDGED.items():
        one, other = full[metric], own[metric]
        if one is not None and other is not None and abs(one.value - other.value) > scatter(one, other):
            (worse if other.value > one.value else better).append(words)
    return worse, better
