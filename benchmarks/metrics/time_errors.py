"""Metrics exact/*, velocity/*, acceleration/*, time_error/*: errors in time.

Metrics velocity/error, acceleration/error: all vertices against the reference, by finite differences.

    v_t = (x_t - x_{t-1}) / dt      a_t = (x_t - 2 x_{t-1} + x_{t-2}) / dt^2      dt = time of a frame

and the error is the root mean square of |v - v_ref|, or |a - a_ref|, over vertices and evaluated frames.

Metrics time_error/*: how far the reference is from the limit of small time steps, where it shows one.

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

from benchmarks.metric import Measurements, Metric
from benchmarks.metrics import curvature, energy

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

EXACT_METRICS = (
    Metric(
        name="exact/distance", unit="m", title="From the exact answer", table="speed", lower_is_better=True,
        definition="largest distance of any vertex at any frame from backward Euler's own exact answer",
    ),
)  # fmt: skip


def measure_exact(roll_out: RollOut) -> dict[str, float]:
    """Return the largest distance of any vertex at any frame [m]; empty without an exact answer."""
    exact = roll_out.scene.exact
    if exact is None:
        return {}
    apart = np.linalg.norm(roll_out.positions - exact[: len(roll_out.positions)], axis=2)
    return {"exact/distance": float(apart.max())}


DIFFERENCES = {"velocity": 1, "acceleration": 2}  # of the difference in time

_metric_velocity = partial(Metric, table="motion_error", lower_is_better=True)

VELOCITY_METRICS = (
    _metric_velocity(name="velocity/error", unit="m/s", title="Velocity error",
            definition="root mean square difference of the velocities of the same vertices, (x - x') / dt "
            "with x' the frame before, over evaluated frames"),
    _metric_velocity(name="acceleration/error", unit="m/s^2", title="Acceleration error",
            definition="the same of accelerations, (x - 2 x' + x'') / dt^2"),
)  # fmt: skip


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return the errors of velocity [m/s] and acceleration [m/s^2]; none where frames are left out."""
    scene, frames = roll_out.scene, roll_out.judged_beside(reference.positions)
    if scene.kept is not None:
        return {}
    apart = roll_out.positions[frames] - reference.positions[frames]
    return {
        f"{name}/error": rms_rate(apart, scene.dt, order)
        for name, order in DIFFERENCES.items()
        if len(apart) > order
    }


def rms_rate(vectors: np.ndarray, dt: float, order: int) -> float:
    """Return the root mean square length of a finite difference in time of vectors (T,V,3).

    Args:
        vectors: (T,V,3), more frames than `order`.
        dt: time between frames [s].
        order: 1 for the velocity, 2 for the acceleration.

    >>> round(rms_rate(np.array([0.0, 0.1, 0.4])[:, None, None] * np.array([0.0, 0.6, 0.8]), 0.1, 2), 9)
    20.0
    """
    rates = np.diff(vectors, n=order, axis=0) / dt**order
    return float(np.sqrt((rates**2).sum(-1).mean()))


BELIEVED_ORDERS = 0.5, 1.5  # observed ones between which the formula is believed

_metric_time_error = partial(Metric, table="time_error")

TIME_ERROR_METRICS = (
    _metric_time_error(name="time_error/curvature", unit="1/m", title="Time error of mean curvature",
            definition="mean curvature of the reference less its limit of small time steps, by Richardson; "
            "only where its own observed order is 0.5 to 1.5"),
    _metric_time_error(name="time_error/order", unit="1", title="Observed order",
            definition="order in dt that the total energy shows; 1 where a limit is near, none without a "
            "trend"),
    _metric_time_error(name="time_error/*", unit="J", title="Time error of {}",
            definition="energy of the reference less its limit of small time steps, by Richardson; only "
            "where its own observed order is 0.5 to 1.5"),
    _metric_time_error(name="time_error/eighth/curvature", unit="1/m",
            title="Mean curvature less that at dt/8",
            definition="mean curvature of the reference less that with an eighth of its time step, where no "
            "limit shows"),
    _metric_time_error(name="time_error/eighth/*", unit="J", title="{} less that at dt/8",
            definition="energy of the reference less that with an eighth of its time step, where no limit "
            "shows"),
)  # fmt: skip


def measure_time_error(roll_out: RollOut) -> dict[str, float]:
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
    values = energy.measure_energy(one) | curvature.measure(one)
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
        if BELIEVED_ORDERS[0] <= order <= BELIEVED_ORDERS[1]:
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

EXACT = Measurements("exact", EXACT_METRICS, measure=measure_exact)

VELOCITY = Measurements("velocity", VELOCITY_METRICS, compare=compare)

TIME_ERROR = Measurements("time_error", TIME_ERROR_METRICS, measure=measure_time_error)
