"""Metric solver/relaxed_frames: frames that are within their tolerance up to round-off alone."""

from __future__ import annotations

from benchmarks.metric import Metric, RollOut

RELAXED = "relaxed"  # the simulator's field of frames
METRICS = (
    Metric(
        name="solver/relaxed_frames",
        unit="frames",
        title="Relaxed",
        definition="frames with a step whose residual, or the round-off in it, is above the tolerance",
        lower_is_better=True,
    ),
)


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the number of relaxed frames of a method that minimises to a tolerance, over all frames."""
    fields = roll_out.trajectory.frame_fields
    return {METRICS[0].name: float(fields[RELAXED].sum())} if RELAXED in fields else {}
