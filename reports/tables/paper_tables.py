"""Tables 1 and 2 of the paper with our numbers beside its own, one number a cell.

Ours are over those of the paper's four test sequences that a run has, and over all motions of its first
garment: each frame weighs the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from reports.finished_run import Run
from reports.statistics.means_and_spreads import match_scenes, recording_of
from reports.tables.table import Cells, Column, Table, join, table

TEST_CLIPS = ("01_01", "07_02", "104_54", "55_27")
# Energy -> of PBNS and of SNUG [J].
TABLE_1 = {
    "strain": (0.111, 0.064), "bending": (0.007, 0.004), "gravity": (0.044, 0.028),
    "inertia": (0.0035, 0.0034),
}  # fmt: skip
# Term that is left out of the loss -> mean-curvature error, whose operator and unit are not stated.
TABLE_2 = {"": 2.7, "bending": 17.3, "strain": 19.1, "gravity": 7.5, "inertia": 2.8}
CURVATURE = ("curvature/histogram", "curvature/mean_difference", "curvature/error")
MOTIONS = Column("motions", "Motions", text=True)


def paper_tables(run: Run) -> list[Table]:
    """Make both tables by the paper's recipe, for page one, and by the default one."""
    rows = run.garment_rows[run.garment_rows["usable"]]
    means = rows.groupby(["method", "metric", "scene"], observed=True)["value"].mean()
    return [
        *_energies(run, means, "paper_table_1", "pbns-paper", "snug-paper"),
        *_curvature(run, means, "paper_table_2", "snug-paper"),
        *_energies(run, means, "table_1", "pbns", "snug"),
        *_curvature(run, means, "table_2", "snug"),
    ]


def _samples(run: Run, methods: Sequence[str], metric: str) -> Mapping[str, pd.Series]:
    """Return set of motions -> evaluated frames of each scene that all the methods have."""
    if run.frame_energies.empty:
        return {}
    rows = run.select_garment(run.first_garment)
    frames = run.frame_energies.groupby("scene")["seconds"].nunique()
    frames = frames.reindex(match_scenes(rows, methods, metric)).dropna()
    clips = frames.index.map(lambda scene: recording_of(scene).partition("/")[2])
    of_paper = join([name for name in TEST_CLIPS if name in set(clips)])
    samples = {of_paper: frames[clips.isin(TEST_CLIPS)], f"all motions ({len(frames)})": frames}
    return {name: part for name, part in samples.items() if len(part)}


def _mean(means: pd.Series, method: str, metric: str, frames: pd.Series) -> float | None:
    """Return the mean over these frames of (method, metric, scene) -> mean; None where a scene lacks it."""
    values = means.get((method, metric))
    if values is None or not frames.index.isin(values.index).all():
        return None
    return float(np.average(values[frames.index], weights=frames))


def _energies(run: Run, means: pd.Series, name: str, pbns: str, snug: str) -> list[Table]:
    """Tabulate energies. Gravity has no ratio: its zero is a choice, and the paper does not state its own."""
    lines: list[Cells] = []
    for motions, frames in _samples(run, (pbns, snug), "energy/strain").items():
        for term, printed in TABLE_1.items():
            ours = [_mean(means, method, f"energy/{term}", frames) for method in (pbns, snug)]
            ratios = [
                two / one if one and two and term != "gravity" else None for one, two in (ours, printed)
            ]
            lines.append((motions, term, *(x for pair in zip(ours, printed) for x in pair), *ratios))
    columns = (
        MOTIONS, Column("energy", "Energy", text=True),
        Column("pbns", "PBNS", "J"), Column("pbns_paper", "PBNS, in the paper", "J", trim=True),
        Column("snug", "SNUG", "J"), Column("snug_paper", "SNUG, in the paper", "J", trim=True),
        Column("ratio", "SNUG / PBNS", digits=2),
        Column("ratio_paper", "SNUG / PBNS, in the paper", digits=2),
    )  # fmt: skip
    caption = (
        f"The paper's table 1 beside {run.label(pbns)} and {run.label(snug)}, means over the frames of the "
        "motions. The paper's are over 598 frames of its four test sequences; it does not state where its "
        "gravity is zero."
    )
    return table(name, columns, lines, caption, grouped_by=("motions",))


def _curvature(run: Run, means: pd.Series, name: str, base: str) -> list[Table]:
    """Tabulate curvature by the full loss and without each term; none where the full one ran alone.

    Below stand the other members of the reference's family, whose errors are a floor.
    """
    named = {term: f"{base}-no-{term}" if term else base for term in TABLE_2}
    variants = {term: method for term, method in named.items() if method in {base, *run.methods}}
    if len(variants) == 1:
        return []
    lines: list[Cells] = []
    for motions, frames in _samples(run, tuple(variants.values()), CURVATURE[0]).items():
        values = {
            method: [_mean(means, method, metric, frames) for metric in CURVATURE]
            for method in (*variants.values(), *run.reference_family)
        }
        full = values[base][0]
        for term, method in variants.items():
            distance, *others = values.pop(method)
            ratio, printed = distance / full if distance and full else None, TABLE_2[term]
            title = f"without {term}" if term else "full loss"
            lines.append((motions, title, distance, ratio, *others, printed, printed / TABLE_2[""]))
        for method, (distance, *others) in values.items():
            if distance is not None:
                lines.append((motions, run.label(method), distance, None, *others, None, None))
    columns = (
        MOTIONS, Column("loss", "Loss", text=True),
        Column(CURVATURE[0], "Curvature, distribution", "1/m"), Column("ratio", "Over full", digits=2),
        Column(CURVATURE[1], "Difference of means", "1/m"),
        Column(CURVATURE[2], "Vertex-wise error", "1/m"),
        Column("paper", "Error in the paper", trim=True),
        Column("ratio_paper", "Over full, in the paper", digits=2),
    )  # fmt: skip
    below = any(line[-1] is None for line in lines)  # of which the paper has no number
    floor = " Below: the reference from another start or with smaller time steps, a floor of the errors."
    caption = (
        f"The paper's table 2 beside curvature of {run.label(base)} against the reference, means over the "
        f"frames of the motions.{floor * below} The paper states neither operator nor unit of its error."
    )
    return table(name, columns, lines, caption, grouped_by=("motions",))
