"""Table of trainings: how each ended."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reports.run.finished_run import Run
from reports.run.training_histories import LAST, History
from reports.statistics.means_and_spreads import Mean
from reports.tables.table import GARMENT, METHOD, Cell, Column, Table, table


def trainings(run: Run) -> list[Table]:
    """Tabulate how long each network trained and how its loss ended; means over seeds."""
    groups: dict[tuple[str, str], list[History]] = {}
    for history in run.histories:
        groups.setdefault((history.garment, history.method), []).append(history)
    place = {method: k for k, method in enumerate(run.ordered({method for _, method in groups}))}
    lines: list[tuple[Cell, ...]] = []
    for (garment, method), histories in sorted(groups.items(), key=lambda item: place[item[0][1]]):
        ends = [
            (h.frames, h.rows[-1]["step"], h.best_step, h.rows[-1]["seconds"], h.last_loss, h.decrease)
            for h in histories
        ]
        lines.append((garment, method, len(histories), *map(_over_seeds, zip(*ends)), histories[0].unit))
    order = list(dict.fromkeys(history.garment for history in run.histories))
    lines.sort(key=lambda line: order.index(str(line[0])))
    columns = (
        GARMENT, METHOD,
        Column("seeds", "Seeds"), Column("frames", "Frames", digits=6, trim=True),
        Column("steps", "Steps", digits=6, trim=True),
        Column("best", "Best on held-out", digits=6, trim=True), Column("seconds", "Training", "s"),
        Column("loss", "Loss at its end", mixed=True), Column("decrease", "Fell in last fifth", "%"),
        Column("unit", "Unit of loss", text=True),
    )  # fmt: skip
    filled = [k for k in range(len(columns)) if any(line[k] is not None for line in lines)]
    lines = [tuple(line[k] for k in filled) for line in lines]
    caption = (
        f"How trainings ended. Losses are means of {LAST} logged ones. The fall is from the {LAST} before "
        "four fifths of the steps. Where the rate falls to zero, a loss levels off by itself."
    )
    return table("trainings", [columns[k] for k in filled], lines, caption, grouped_by=("garment",))


def _over_seeds(values: Sequence[float | None]) -> Mean | float | None:
    """Return mean and spread of the values; a number that no seed changes as it is."""
    known = {("", seed): x for seed, x in enumerate(values) if x is not None and np.isfinite(x)}
    numbers = np.array(list(known.values()), dtype=float)
    if len(numbers) == len(values) and len(set(known.values())) == 1:
        return float(numbers[0])
    spread = float(numbers.std(ddof=1)) if len(numbers) > 1 else None
    return Mean(float(numbers.mean()), spread, len(numbers), len(values), cells=known) if known else None
