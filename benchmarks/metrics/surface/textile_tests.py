"""Metrics fabric/*: what a textile test reads off the last frame, and its error."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from benchmarks.metric import Metric

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.metric import RollOut

_metric = partial(Metric, table="fabric")

METRICS = (
    _metric(name="fabric/bending_length", unit="mm", title="Bending length",
            definition="bending length of the elastica whose chord has the strip's angle, at the last frame"),
    _metric(name="fabric/drape_coefficient", unit="%", title="Drape coefficient",
            definition="shadow less the plate, over the specimen less the plate (areas), at the last frame"),
    _metric(name="fabric/error", unit="%", title="Error of the test", lower_is_better=True,
            definition="of a bending length: its distance from (rigidity / weight)^(1/3), over that; of a "
            "drape coefficient: its difference from the reference's, in points"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return what the specimen reads off the last frame, and its error where the exact answer is known."""
    specimen, last = roll_out.scene.specimen, _last(roll_out)
    if specimen is None or last is None:
        return {}
    error = specimen.error(last)
    return specimen.measure(last) | ({} if error is None else {"fabric/error": error})


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return the error to the reference, where no exact answer is known."""
    specimen, last, rest = roll_out.scene.specimen, _last(roll_out), _last(reference)
    if specimen is None or last is None or rest is None or specimen.error(last) is not None:
        return {}
    values, expected = specimen.measure(last), specimen.measure(rest)
    return {"fabric/error": max(abs(values[name] - expected[name]) for name in values)}


def _last(roll_out: RollOut) -> np.ndarray | None:
    """Return the last frame (V, 3) [m]; None where the roll-out ended before it."""
    whole = len(roll_out.positions) == roll_out.scene.frames
    return roll_out.positions[-1] if whole else None
