"""A whole training of recipe default at the paper's size, rolled out on a motion that it does not see.

Time is that of training: what the validations take is left out. Writes convergence.csv, the curve, and the
network into the folder; a run that was killed goes on from its last checkpoint there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..parts import Row, write_table
from .settings import VALIDATION, Settings, dressed_body, kind_and_vertices, training_motions
from .step import PAPER_STEPS

CASES = ("snug, 4400",)
POINTS = 60  # of the curve
CLOSE = (0.03, 0.01)  # shares of the last value within which a curve counts as there
PAPER_SECONDS = 2 * 3600.0  # of the paper's training, on a GPU
COLUMNS = ("step", "seconds", "loss", "validation", "strain", "bending", "gravity", "inertia", "collision")


def measure(case: str, settings: Settings) -> list[Row]:
    """Train; when the value on the held-out motion came close to its last one, and for good."""
    from snug.recipe import TRAININGS
    from snug.train import train
    from snug.training_run import Saving
    from snug.validation import Validation

    kind, vertices = kind_and_vertices(case)
    motions, every = training_motions(), max(1, settings.steps // POINTS)
    held_out = [motion for motion in motions if motion.name == VALIDATION]
    path = settings.folder / "models" / f"{kind}.safetensors"
    path.parent.mkdir(parents=True, exist_ok=True)
    saving = Saving(path=path.with_name(f"{kind}-{settings.device}.checkpoint.safetensors"), resume=True)
    dressed = dressed_body(vertices)
    model = train(
        TRAININGS[kind].kind, dressed, [motion for motion in motions if motion not in held_out],
        steps=settings.steps, seed=0, recipe=TRAININGS[kind].recipe, every=every, device=settings.device,
        saving=saving, validation=Validation(motions=held_out, every=every, patience=0),
    )  # fmt: skip
    model.save(path)
    points = curve(model.history)
    write_table(settings.folder / "convergence.csv", COLUMNS, points)
    saving.done()
    return [
        ("vertices", dressed.vertices, ""),
        ("frames to learn from", model.summary["training_frames"], ""),
        ("made ready in", model.setup_seconds, "s"),
        *_found(points),
    ]


def curve(history: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """The columns of convergence.csv: steps so far, seconds without validations, joules a frame."""
    points, before, left_out = [], 0.0, 0.0
    for row in history:
        left_out += (row["step"] - before) * row.get("seconds/validation", 0.0)
        before = row["step"]
        point = {name: row[name] for name in COLUMNS if name in row}
        point.setdefault("validation", math.nan)
        points.append(point | {"seconds": row["seconds"] - left_out})
    return points


def _found(points: Sequence[Mapping[str, float]]) -> list[Row]:
    steps, seconds, validation = (
        np.array([point[name] for point in points]) for name in ("step", "seconds", "validation")
    )
    pace = float(np.median(np.diff(seconds, prepend=0.0) / np.diff(steps, prepend=0.0)))
    rows: list[Row] = [
        ("steps", int(steps[-1]), ""),
        ("step, median", 1e3 * pace, "ms"),
        ("all steps", float(seconds[-1]), "s"),
        ("all steps, share of the paper's 2 h", 100 * float(seconds[-1]) / PAPER_SECONDS, "%"),
        ("window loss at the end", points[-1]["loss"], "J"),
        ("validation at the end", float(validation[-1]), "J"),
        ("validation at its best", float(np.nanmin(validation)), "J"),
    ]
    for share in CLOSE:
        there = arrival(validation, share)
        rows += [
            (f"validation within {100 * share:.0f} % of its end: steps", int(steps[there]), ""),
            (f"validation within {100 * share:.0f} % of its end: time", float(seconds[there]), "s"),
        ]
    return [*rows, (f"{PAPER_STEPS} steps at the median", PAPER_STEPS * pace / 3600, "h")]


def arrival(values: np.ndarray, share: float) -> int:
    """The first place from which on every value is within that share of the last one; where that is no
    number, the last place.
    """
    far = np.flatnonzero(~(np.abs(values - values[-1]) <= share * abs(values[-1])))  # so is what is no number
    return min(int(far[-1]) + 1, len(values) - 1) if len(far) else 0
