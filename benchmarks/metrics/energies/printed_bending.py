"""Metric energy/bending_printed: bending of the same hinges as the SNUG paper prints them, not scaled.

Papers of the field give one or the other under the same name. It is no part of the total.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

METRICS = (
    Metric(
        name="energy/bending_printed", unit="J", title="Bending, as printed", lower_is_better=True,
        definition="energy of the same hinges without their scale, k/2 theta^2 as the SNUG paper prints it; "
        "no part of the total; mean over frames",
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the mean [J per frame]; empty where the scene's own hinges are not scaled."""
    from reference_sim.energies.bend_hinge import BendHinge  # loads numba

    hinges = [term for term in roll_out.scene.energies if isinstance(term, BendHinge)]
    if [term.scaling for term in hinges] != ["length_area"]:
        return {}
    printed = BendHinge(hinges[0].cloth, scaling="none", rest_angles=hinges[0].rest_angles)
    frames = map(np.ascontiguousarray, roll_out.positions[roll_out.judged])
    return {"energy/bending_printed": float(np.mean([printed.value_and_gradient(x)[0] for x in frames]))}
