"""SNUG less one ingredient at a time, beside the full recipe: what leaving it out makes worse, and better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.results import Row
from reports.scatter import difference
from reports.summary import TSHIRT, Mean, Measurements, suite_rows, wardrobe
from reports.table import Cell, Column, Table

FULL = "snug"
ROLL_OUTS = "roll-outs"  # suite of rows that belong to a network of the T-shirt, not to a scene of a garment
LONG, TRAINING = ("there_and_back",), ("training",)  # its scenes: a thousand frames, and the training motions
ABLATIONS = {
    "snug-no-bending": "without bending",
    "snug-no-strain": "without strain",
    "snug-no-gravity": "without gravity",
    "snug-no-inertia": "without inertia",
    "snug-no-noise": "with first states of zero",
    "snug-noise-alone": "with first states of noise, none remembered",
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
    "dynamics/amplitude": Column("amplitude", "A"),
    "dynamics/correlation": Column("correlation", "Correlation"),
    "roll_out/drift": Column("drift", "Drift", "mm"),
}
# A term that is left out of the loss is of course larger; the total is the full recipe's own loss, curvature
# error (the paper's measure) is nobody's.
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
    "scatter of seeds, over the scenes that both have.",
}


# Where each metric of a garment is found, and in which scenes.
Source = dict[str, tuple[Measurements, Sequence[str]]]


def ablations(rows: Sequence[Row]) -> Table | None:
    """The numbers of the full recipe and of each ablation that ran, by garment; None where none did."""
    lines: list[tuple[Cell, ...]] = [
        (garment, method, *(measured.mean(method, m, scenes) for m, (measured, scenes) in source.items()))
        for garment, ran, source in _garments(rows)
        for method in (FULL, *ran)
    ]
    return Table("ablations", (*HEAD, *COLUMNS.values()), tuple(lines)) if lines else None


def ablations_judged(rows: Sequence[Row]) -> Table | None:
    """In words, by garment: in which measures each ablation is worse or better than the full recipe."""
    lines: list[tuple[Cell, ...]] = [
        (garment, method, *(", ".join(f"{what}{fewer}" for what, fewer in way.items()) for way in ways))
        for garment, own in judged_ablations(rows).items()
        for method, ways in own.items()
    ]
    columns = (*HEAD, Column("worse", "Worse in"), Column("better", "Better in"))
    return Table("ablations_judged", columns, tuple(lines)) if lines else None


def set_apart(measured: Measurements, scenes: Sequence[str], metric: str = "energy/total") -> list[str]:
    """The ablations with the metric in these scenes, if the full recipe has it too: they stand below it."""
    ran = [m for m in (FULL, *ABLATIONS) if measured.mean(m, metric, scenes) is not None]
    return ran[1:] if ran[:1] == [FULL] else []


def _garments(rows: Sequence[Row]) -> Iterator[tuple[str, list[str], Source]]:
    """Of the garments on which the full recipe and some ablation ran."""
    worn, roll_outs = (Measurements(suite_rows(rows, suite)) for suite in ("garments", ROLL_OUTS))
    for garment, scenes in wardrobe(worn).items():
        if ran := set_apart(worn, scenes):
            long = roll_outs if garment == TSHIRT else Measurements(())
            yield (
                garment,
                ran,
                {
                    metric: (long, LONG) if metric.startswith("roll_out/") else (worn, scenes)
                    for metric in COLUMNS
                },
            )


def judged_ablations(rows: Sequence[Row]) -> dict[str, dict[str, tuple[dict[str, str], dict[str, str]]]]:
    """garment -> ablation -> the measures in which it is worse than the full recipe, and better.

    Each measure comes with words that say where it was compared over fewer scenes than all.
    """
    return {
        garment: {method: _judged(method, source) for method in ran}
        for garment, ran, source in _garments(rows)
    }


def compared_in(rows: Sequence[Row]) -> dict[str, list[str]]:
    """garment -> the measures that the full recipe and some ablation have in one scene at least."""
    found = {}
    for garment, ran, source in _garments(rows):
        had = {words for method in ran for words, _, _ in _compared(method, source)}
        found[garment] = [words for words in JUDGED.values() if words in had]
    return found


def _compared(method: str, source: Source) -> Iterator[tuple[str, Mean, Mean]]:
    """Each measure that the full recipe and the ablation have, with both means."""
    for metric, words in JUDGED.items():
        measured, scenes = source[metric]
        full, own = measured.pair(FULL, method, metric, scenes)
        if full is not None and own is not None:
            yield words, full, own


def _judged(method: str, source: Source) -> tuple[dict[str, str], dict[str, str]]:
    worse: dict[str, str] = {}
    better: dict[str, str] = {}
    for words, full, own in _compared(method, source):
        if sign := difference(own, full):
            (worse if sign > 0 else better)[words] = own.fewer
    return worse, better
