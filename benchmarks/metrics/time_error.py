"""How far the reference itself is from the limit of small time steps, by Richardson's extrapolation.

Backward Euler is of first order in dt, so of a quantity q taken at steps dt/4 and dt/8

    q* = 2 q(dt/8) - q(dt/4),        error of the reference = q(dt) - q*

The order that the three finest differences show, log2 |q(dt/2) - q(dt/4)| / |q(dt/4) - q(dt/8)|, says whether
the formula may be believed: 1 where it holds, anything where cloth folds otherwise at every step length.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..metric import Metric
from . import curvature, energy

if TYPE_CHECKING:
    from ..metric import RollOut

METRICS = (
    Metric(
        name="time_error/curvature", unit="1/m", title="Time error of mean curvature", table="time_error",
        definition="mean curvature of the reference less its limit of small time steps, by Richardson",
    ),
    Metric(
        name="time_error/order", unit="1", title="Observed order", table="time_error",
        definition="order in dt that the total energy shows; 1 where the extrapolation may be believed",
    ),
    Metric(
        name="time_error/*", unit="J", title="Time error of {}", table="time_error",
        definition="energy of the reference less its limit of small time steps, by Richardson",
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    group = roll_out.group
    if roll_out is not group.reference:
        return {}
    finer = [group.find(role="reference-variant", family="simulation-dt", level=n) for n in (2, 4, 8)]
    ladder = [roll_out, *(found for found in finer if found is not None)]
    if len(ladder) < 4:
        return {}
    return time_errors([energy.measure(one) | curvature.measure(one) for one in ladder])


def time_errors(ladder: list[dict[str, float]]) -> dict[str, float]:
    """time_error/<quantity> and time_error/order, from the metrics at dt, dt/2, dt/4 and dt/8.

    Quantities are the energies [J] and mean curvature [1/m].
    """
    whole, half, quarter, eighth = ladder
    errors = {}
    for metric in whole:
        limit = 2.0 * eighth[metric] - quarter[metric]
        errors[f"time_error/{_QUANTITIES.get(metric, metric.removeprefix('energy/'))}"] = (
            whole[metric] - limit
        )
    coarse = abs(half["energy/total"] - quarter["energy/total"])
    fine = abs(quarter["energy/total"] - eighth["energy/total"])
    if coarse > 0.0 and fine > 0.0:
        errors["time_error/order"] = float(np.log2(coarse / fine))
    return errors


_QUANTITIES = {"curvature/mean": "curvature"}
