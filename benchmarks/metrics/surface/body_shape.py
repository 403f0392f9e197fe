"""Metric body/shape: how far a body is from the mean one; in the reference's rows alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

METRICS = (
    Metric(
        name="body/shape", unit="1", title="Body shape",
        definition="norm of the body's shape coefficients, 0 for the mean body",
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the norm of the shape coefficients; of the reference alone."""
    dressed = roll_out.scene.dressed
    if roll_out.entry.role != "reference" or dressed is None:
        return {}
    return {"body/shape": 0.0 if dressed.betas is None else float(np.linalg.norm(dressed.betas))}
