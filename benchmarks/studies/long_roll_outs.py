"""A thousand frames without a restart: does a network's garment end where it began, or wear out on the way?

The first test motion runs forwards and backwards until the frame on which a last hundred frames begins that
shows the same motion as the first hundred: for a garment whose state has not gone astray both are equal, and
no change of motion blurs the comparison. Energies are those of the cloth alone (strain, bending, inertia),
which need no body; frames 1 and 2 have no inertia and are left out at both ends.

    roll_out/first, roll_out/last   mean J per frame of the first and of the last hundred frames
    roll_out/drift                  mm, root mean square distance between the two
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..methods.networks import model_path
from ..results import Row, RunFolder

if TYPE_CHECKING:
    from snug.dressed_body import DressedBody
    from snug.motion import Motion

    from ..plan import Plan
    from ..wardrobe import Wardrobe

# A suite of rows alone: means over the scenes of garments stay clean.
SUITE, SCENE = "roll-outs", "there_and_back"
FRAMES, ENDS = 1000, 100
FIRST_FULL = 2
MM = 1e3


def there_and_back(motion: Motion) -> Motion:
    """The motion again and again, every second time backwards, for `FRAMES` frames or a few more."""
    count = motion.frames
    period = np.concatenate([np.arange(count), np.arange(count - 2, 0, -1)])
    rounds = -(-(FRAMES - ENDS) // len(period))
    order = np.resize(period, rounds * len(period) + ENDS)
    return replace(motion, poses=motion.poses[order], translations=motion.translations[order])


def rows(plan: Plan, folder: RunFolder, wardrobe: Wardrobe | None) -> list[Row]:
    """Those of every network that the run has trained."""
    from snug.dressed_body import DressedBody
    from snug.rollout import roll_out
    from snug.trained_model import TrainedModel

    if wardrobe is None or not plan.models:
        return []
    dressed = DressedBody(wardrobe.body, wardrobe.garment)
    motion = there_and_back(wardrobe.motions[plan.test[0]])
    found: list[Row] = []
    for name, seed in plan.models:
        path = model_path(folder.models, name, seed)
        if not path.is_file():
            continue  # its training has failed, and the run says so
        positions = roll_out(TrainedModel.load(path), dressed, motion).positions
        found += _judged(name, seed, positions, dressed, motion.fps)
    return found


def _judged(name: str, seed: int, positions: np.ndarray, dressed: DressedBody, fps: float) -> Iterator[Row]:
    if not np.isfinite(positions).all():
        frame = int(np.argwhere(~np.isfinite(positions).all(axis=(1, 2)))[0, 0])
        reason = f"not finite from frame {frame} of {len(positions)} on"
        yield Row(SUITE, SCENE, name, seed, "roll_out/last", "J", None, "diverged", reason, dtype="float32")
        return
    first, last = positions[:ENDS], positions[-ENDS:]
    drift = MM * float(np.sqrt(((last - first)[FIRST_FULL:] ** 2).sum(-1).mean()))
    numbers = {
        "roll_out/first": (cloth_energy(first, dressed, fps), "J"),
        "roll_out/last": (cloth_energy(last, dressed, fps), "J"),
        "roll_out/drift": (drift, "mm"),
    }
    for metric, (value, unit) in numbers.items():
        yield Row(SUITE, SCENE, name, seed, metric, unit, value, dtype="float32")


def cloth_energy(positions: np.ndarray, dressed: DressedBody, fps: float) -> float:
    """Mean strain, bending and inertia of frames (T,V,3) [m] from the third on [J per frame]."""
    from reference_sim.energies import BendHinge, Inertia, StretchStVK

    static, inertia = (StretchStVK(dressed.cloth), BendHinge(dressed.cloth)), Inertia(dressed.cloth, 1 / fps)
    total = 0.0
    for before, previous, x in zip(positions, positions[1:], positions[FIRST_FULL:]):
        total += inertia.value_and_gradient(x, 2 * previous - before)[0]
        total += sum(term.value_and_gradient(np.ascontiguousarray(x))[0] for term in static)
    return total / (len(positions) - FIRST_FULL)
