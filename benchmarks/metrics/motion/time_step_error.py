"""Metrics time_error/*: how far the reference is from the limit of small time steps, where it shows one.

Backward Euler is of first order in dt, so of a quantity q taken at steps dt/4 and dt/8

    q* = 2 q(dt/8) - q(dt/4),        error of the reference = q(dt) - q*        (Richardson 1911)

where the three finest steps show that order, log2 of (q(dt/2) - q(dt/4)) / (q(dt/4) - q(dt/8)). Cloth without
damping has vibrations too fast for these steps; its energies grow by as much with each halving, and no limit
can be told. Then q(dt) - q(dt/8) alone is known, and the error is not smaller if the trend goes on.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric
from benchmarks.metrics.energies import energy
from benchmarks.metrics.surface import curvature

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

ORDERS = 0.5, 1.5  # observed ones between which the formula is believed

_metric = partial(Metric, table="time_error")

METRICS = (
    _metric(name="time_error/curvature", unit="1/m", title="Time error of mean curvature",
            definition="mean curvature of the reference less its limit of small time steps, by Richardson; "
            "only where its own observed order is 0.5 to 1.5"),
    _metric(name="time_error/order", unit="1", title="Observed order",
            definition="order in dt that the total energy shows; 1 where a limit is near, none without a "
            "trend"),
    _metric(name="time_error/*", unit="J", title="Time error of {}",
            definition="energy of the reference less its limit of small time steps, by Richardson; only "
            "where its own observed order is 0.5 to 1.5"),
    _metric(name="time_error/eighth/curvature", unit="1/m", title="Mean curvature less that at dt/8",
            definition="mean curvature of the reference less that with an eighth of its time step, where no "
            "limit shows"),
    _metric(name="time_error/eighth/*", unit="J", title="{} less that at dt/8",
            definition="energy of the reference less that with an eighth of its time step, where no limit "
            "shows"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return errors of the reference, where its simulations at dt/2, dt/4 and dt/8 ran."""
    group = roll_out.group
    if roll_out is not group.reference:
        return {}
    finer = [group.find(role="reference-variant", family="simulation-dt", level=n) for n in (2, 4, 8)]
    ladder = [roll_out, *(variant for variant in finer if variant is not None)]
    if len(ladder) < 4:
        return {}
    return time_errors([_quantities(one) for one in ladder])


def _quantities(one: RollOut) -> dict[str, float]:
    """Return energies [J] and mean curvature [1/m] of a roll-out."""
    values = energy.measure(one) | curvature.measure(one)
    return {
        name: value for name, value in values.items() if name in _QUANTITIES or name.startswith("energy/")
    }


def time_errors(ladder: list[dict[str, float]]) -> dict[str, float]:
    """Return the error of each quantity, or its difference to dt/8, and the order of the total energy.

    ladder: energies [J] and mean curvature [1/m] at dt, dt/2, dt/4 and dt/8.

    >>> errors = time_errors([{"energy/total": 1.0 + step} for step in (1.0, 0.5, 0.25, 0.125)])
    >>> errors["time_error/order"], errors["time_error/total"]
    (1.0, 1.0)
    """
    whole, half, quarter, eighth = ladder
    errors = {}
    for metric in whole:
        name = _QUANTITIES.get(metric, metric.removeprefix("energy/"))
        order = observed_order(half[metric], quarter[metric], eighth[metric])
        if ORDERS[0] <= order <= ORDERS[1]:
            errors[f"time_error/{name}"] = whole[metric] - (2.0 * eighth[metric] - quarter[metric])
        else:
            errors[f"time_error/eighth/{name}"] = whole[metric] - eighth[metric]
        if metric == "energy/total" and np.isfinite(order):
            errors["time_error/order"] = order
    return errors


def observed_order(half: float, quarter: float, eighth: float) -> float:
    """Return the order in dt of a quantity at dt/2, dt/4 and dt/8; nan where it stays or turns back.

    >>> observed_order(4.0, 2.0, 1.0)
    1.0
    """
    coarse, fine = half - quarter, quarter - eighth
    return float(np.log2(coarse / fine)) if coarse * fine > 0.0 else float("nan")


_QUANTITIES = {"curvature/mean": "curvature"}
