"""Microbenchmark convergence/*: a whole training, rolled out on a held-out motion.

Time is that of training: what the validations take is left out. Leaves the curve and the network; a run that
was killed goes on from its last checkpoint. The report draws the curve.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from benchmarks.performance.learning import dressed_body, training_motions
from benchmarks.performance.microbenchmark import Settings
from benchmarks.performance.training_step import PAPER_STEPS
from reference_sim.files.atomic_files import replacing
from snug.training.checkpoint import Checkpoint
from snug.training.train_network import train_network
from snug.training.validation import Validation

HELD_OUT = "05_14"  # the training motion that is rolled out
POINTS = 60  # of the curve
CLOSE = (3, 1)  # [%] of the last value within which a curve counts as there
PAPER_SECONDS = 2 * 3600.0  # of the paper's training, on a GPU
COLUMNS = ("step", "seconds", "loss", "validation", "strain", "bending", "gravity", "inertia", "collision")


def measure(settings: Settings, *, vertices: int) -> dict[str, float]:
    """Train; return the end of the training and when the held-out energy came close to it, for good."""
    curve_path, path = settings.files
    path.parent.mkdir(parents=True, exist_ok=True)
    checkpoint_path = path.with_name(f".{path.stem}.checkpoint.safetensors")
    checkpoint = Checkpoint(path=checkpoint_path, resume=True, key=settings.key)
    chosen, every = settings.training, max(1, settings.steps // POINTS)
    assert chosen is not None
    dressed, motions = dressed_body(vertices), training_motions()
    held_out = [motion for motion in motions if motion.name == HELD_OUT]
    model = train_network(
        chosen.kind, dressed, [motion for motion in motions if motion not in held_out],
        steps=settings.steps, seed=0, recipe=chosen.recipe, every=every, device=settings.device,
        checkpoint=checkpoint, validation=Validation(motions=held_out, every=every, patience=0),
    )  # fmt: skip
    model.save(path)
    points = curve(model.history)
    with replacing(curve_path) as temporary:
        pd.DataFrame(points, columns=COLUMNS).to_csv(temporary, index=False)
    checkpoint.delete()
    return {
        "vertices": dressed.vertices,
        "training_frames": model.summary["training_frames"],
        "setup": model.setup_seconds,
        **found_on(points),
    }


def curve(history: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """Return the rows of convergence.csv: steps so far, seconds without validations, joules a frame."""
    points, before, left_out = [], 0.0, 0.0
    for row in history:
        left_out += (row["step"] - before) * row.get("seconds/validation", 0.0)
        before = row["step"]
        point = {name: row[name] for name in COLUMNS if name in row}
        point.setdefault("validation", math.nan)
        points.append(point | {"seconds": row["seconds"] - left_out})
    return points


def found_on(points: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the numbers of a curve: end of the training, pace, and when it was close to the end for good."""
    steps, seconds, validation = (
        np.array([point[name] for point in points]) for name in ("step", "seconds", "validation")
    )
    pace = float(np.median(np.diff(seconds, prepend=0.0) / np.diff(steps, prepend=0.0)))
    numbers = {
        "steps": int(steps[-1]),
        "training_step": 1e3 * pace,
        "training": float(seconds[-1]),
        "training_share": 100.0 * float(seconds[-1]) / PAPER_SECONDS,
        "window_loss": points[-1]["loss"],
        "validation": float(validation[-1]),
        "validation_best": float(np.nanmin(validation)),
    }
    for percent in CLOSE:
        place = arrival(validation, percent / 100.0)
        numbers |= {f"steps_to_{percent}": int(steps[place]), f"time_to_{percent}": float(seconds[place])}
    return numbers | {"paper_training": PAPER_STEPS * pace / 3600}


def arrival(values: np.ndarray, share: float) -> int:
    """Return the first place from which on every value is within that share of the last one.

    Where the last is no number, the last place.

    >>> arrival(np.array([9.0, 2.0, 1.02, 1.0]), 0.03)
    2
    """
    far = np.flatnonzero(~(np.abs(values - values[-1]) <= share * abs(values[-1])))  # so is what is no number
    return min(int(far[-1]) + 1, len(values) - 1) if len(far) else 0
