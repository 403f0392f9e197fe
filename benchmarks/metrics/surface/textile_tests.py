"""Metrics fabric/*: what a textile test reads off the last frame, and its error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

METRICS = (
    Metric(
        name="fabric/bending_length", unit="mm", title="Bending length", table="fabric",
        definition="bending length of the elastica whose chord has the strip's angle, at the last frame",
    ),
    Metric(
        name="fabric/drape_coefficient", unit="%", title="Drape coefficient", table="fabric",
        definition="shadow less the plate, over the specimen less the plate (areas), at the last frame",
    ),
    Metric(
        name="fabric/error", unit="%", title="Error of the test", table="fabric", lower_is_better=True,
        definition="of a bending length: its distance from (rigidity / weight)^(1/3), over that; of a drape "
        "coefficient: its difference from the reference's, in points",
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return what the specimen reads off the last frame, and its error; empty where the frame is missing."""
    scene, reference = roll_out.scene, roll_out.reference
    if scene.specimen is None or len(roll_out.positions) < scene.frames:
        return {}
    last = roll_out.positions[-1]
    values = scene.specimen.measure(last)
    error = scene.specimen.error(last, None if reference is None else reference.positions[-1])
    return values if error is None else {**values, "fabric/error": error}
