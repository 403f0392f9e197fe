"""Metrics roll_out/*: does a garment look the same when the same motion comes again, much later?

Energies are those of the cloth alone (strain, bending, inertia), which need no body; the first two frames of
either stretch have no inertia and are left out.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric
from benchmarks.metrics.energies.energy import FIRST_FULL_FRAME, energies

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

MM = 1e3
OF_CLOTH = ("strain", "bending", "inertia")

_metric = partial(Metric, table="roll_outs", lower_is_better=True)

METRICS = (
    _metric(name="roll_out/first", unit="J", title="Energy, first",
            definition="strain, bending and inertia, mean over the frames of the early stretch"),
    _metric(name="roll_out/last", unit="J", title="Energy, last",
            definition="the same of the late stretch, which shows the same motion"),
    _metric(name="roll_out/drift", unit="mm", title="Drift",
            definition="root mean square distance between the two stretches, about the pelvis"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return energies [J] of the early and the late stretch, and the drift between both [mm]."""
    scene, x = roll_out.scene, roll_out.positions
    if scene.repeated is None or scene.dressed is None or len(x) < scene.frames:
        return {}
    early, late = scene.repeated
    kept = np.arange(len(x)) if scene.kept is None else scene.kept
    origins = scene.dressed.motion.translations[kept]
    cloth = np.sum([series for term, series in energies(roll_out).items() if term in OF_CLOTH], axis=0)
    moved = (x[late] - x[early]) - (origins[late] - origins[early])[:, None]
    return {
        "roll_out/first": float(cloth[early][FIRST_FULL_FRAME:].mean()),
        "roll_out/last": float(cloth[late][FIRST_FULL_FRAME:].mean()),
        "roll_out/drift": MM * float(np.sqrt((moved[FIRST_FULL_FRAME:] ** 2).sum(-1).mean())),
    }
