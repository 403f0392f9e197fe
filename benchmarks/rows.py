"""The rows of results.csv that a cell becomes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from snug.recipe import learns_from_simulation

from .cell import Outcome
from .clock import SPREAD, median, spread
from .methods import find_method
from .named_metrics import MM, unit_of
from .results import Row


def model_costs(
    name: str | None, trained: Mapping[str, Any] | None, data_seconds: float | None
) -> dict[str, float]:
    """cost/data, cost/setup, cost/train and cost/memory of a method that uses this network; nothing without
    one.

    trained: what its record says, of whatever version. data_seconds: None where nobody knows them any more;
    then there is no cost/data.
    """
    if name is None or not trained:
        return {}
    data = data_seconds if learns_from_simulation(name) else 0.0
    known = {} if data is None else {"cost/data": data}
    costs = {"cost/setup": "setup_seconds", "cost/train": "seconds", "cost/memory": "megabytes"}
    return known | {metric: trained[key] for metric, key in costs.items() if key in trained}


def clock_costs(outcome: Outcome) -> dict[str, float]:
    """What clock and process give: cost/frame, cost/batch [ms], cost/spread [%], cost/peak [MB].

    A frame's time is the median of the repeats, each the time of the whole run over the frames computed.
    """
    if not outcome.seconds:
        return {}
    costs = {"cost/frame": MM * median(outcome.seconds) / outcome.frames}
    if len(outcome.seconds) > 1:
        costs["cost/spread"] = 100.0 * spread(outcome.seconds)
    if outcome.batch_seconds is not None:
        costs["cost/batch"] = MM * outcome.batch_seconds
    if outcome.peak is not None:
        costs["cost/peak"] = outcome.peak
    return costs


def rows_of(outcome: Outcome, metrics: Mapping[str, float]) -> list[Row]:
    """The rows of a cell in each of its suites; a cell without metrics is one row with its reason."""
    cell = outcome.cell
    rows = []
    for suite in cell.suites:
        base = Row(
            suite, cell.scene.name, cell.method, cell.seed, "cost/frame", "ms", None,
            outcome.status if outcome.status != "ok" else "failed", outcome.reason,
            terms=outcome.terms, dtype=find_method(cell.method).dtype, commit=outcome.commit,
        )  # fmt: skip
        if not metrics:
            rows.append(base)
        for metric, value in metrics.items():
            finite = math.isfinite(value)
            status = outcome.status if finite else ("failed" if outcome.status == "ok" else outcome.status)
            reason = outcome.reason if finite else outcome.reason or f"{metric} is not finite"
            if metric == "cost/spread" and value > 100.0 * SPREAD:
                reason = reason or f"repeats lie more than {100.0 * SPREAD:.0f} % apart: read times with care"
            rows.append(
                dataclasses.replace(
                    base, metric=metric, unit=unit_of(metric), value=float(value) if finite else None,
                    status=status, reason=reason,
                )
            )  # fmt: skip
    return rows
