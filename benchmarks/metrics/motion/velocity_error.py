"""Metrics velocity/error, acceleration/error: all vertices against the reference, by finite differences.

    v_t = (x_t - x_{t-1}) / dt      a_t = (x_t - 2 x_{t-1} + x_{t-2}) / dt^2      dt = time of a frame

and the error is the root mean square of |v - v_ref|, or |a - a_ref|, over vertices and evaluated frames.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

ORDERS = {"velocity": 1, "acceleration": 2}  # of the difference in time

_metric = partial(Metric, table="motion_error", lower_is_better=True)

METRICS = (
    _metric(name="velocity/error", unit="m/s", title="Velocity error",
            definition="root mean square difference of the velocities of the same vertices, (x - x') / dt "
            "with x' the frame before, over evaluated frames"),
    _metric(name="acceleration/error", unit="m/s^2", title="Acceleration error",
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
        for name, order in ORDERS.items()
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
