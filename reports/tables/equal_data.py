"""Table of networks trained on equal data: ablations told apart by a number of mixed frames, their level."""

from __future__ import annotations

import pandas as pd

from benchmarks.results.row import BEFORE_FRAMES
from reports.run.finished_run import Run
from reports.tables.pivot import Pivot

COUNTS = ("cost/train_frames", "cost/train_steps")
JUDGED = ("energy/total", "energy/strain", "penetration/vertices", "curvature/error")


def members(run: Run) -> list[str]:
    """Return the methods of the block, in order."""
    rows = run.garment_rows
    trained = set(rows[rows["usable"] & (rows["metric"] == COUNTS[0])]["method"])
    declared = {name: run.methods[name] for name in run.ordered(trained)}
    return [
        name for name, method in declared.items() if method.role == "ablation" and method.level is not None
    ]


def _lines(run: Run, rows: pd.DataFrame) -> set[tuple[str, ...]]:
    block = members(run)
    return {
        (garment, method) for garment in set(rows["garment"]) for method in (*block, run.reference) if block
    }


EQUAL_DATA = Pivot(
    "equal_data",
    "Networks that learn from the same motions: number of frames, cost and errors.",
    rows=("garment", "method"),
    metrics=(*COUNTS, *BEFORE_FRAMES, *JUDGED),
    select=lambda run: run.garment_rows,
    lines=_lines,
    grouped_by=("garment",),
    counts=COUNTS,
)
