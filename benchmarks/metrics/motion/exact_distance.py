"""Metric exact/distance: distance of a roll-out from the exact answer of its scene, where one is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

METRICS = (
    Metric(
        name="exact/distance", unit="m", title="From the exact answer", table="speed", lower_is_better=True,
        definition="largest distance of any vertex at any frame from backward Euler's own exact answer",
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the largest distance of any vertex at any frame [m]; empty without an exact answer."""
    exact = roll_out.scene.exact
    if exact is None:
        return {}
    apart = np.linalg.norm(roll_out.positions - exact[: len(roll_out.positions)], axis=2)
    return {"exact/distance": float(apart.max())}
