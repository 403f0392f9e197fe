"""How far the reference itself is from the limit of small time steps, by Richardson's extrapolation.

Backward Euler is of first order in dt, so of a quantity q taken at steps dt/4 and dt/8

    q* = 2 q(dt/8) - q(dt/4),        error of the reference = q(dt) - q*

The order that the three finest differences show, log2 |q(dt/2) - q(dt/4)| / |q(dt/4) - q(dt/8)|, says whether
the formula may be believed: 1 where it holds, anything where cloth folds otherwise at every step length.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

LADDER = ("simulation", "simulation-dt/2", "simulation-dt/4", "simulation-dt/8")


def time_errors(found: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """time_error/<quantity> and time_error/order of the reference, from the metrics of each method by name.

    Quantities are the energies [J] and mean curvature [1/m]; nothing where a rung of LADDER is missing.
    """
    if not all(name in found for name in LADDER):
        return {}
    whole, half, quarter, eighth = (found[name] for name in LADDER)
    errors = {}
    for metric in whole:
        if metric.startswith("energy/") or metric == "curvature/mean":
            limit = 2.0 * eighth[metric] - quarter[metric]
            errors[f"time_error/{metric.replace('curvature/mean', 'curvature').removeprefix('energy/')}"] = (
                whole[metric] - limit
            )
    coarse = abs(half["energy/total"] - quarter["energy/total"])
    fine = abs(quarter["energy/total"] - eighth["energy/total"])
    if coarse > 0.0 and fine > 0.0:
        errors["time_error/order"] = float(np.log2(coarse / fine))
    return errors
