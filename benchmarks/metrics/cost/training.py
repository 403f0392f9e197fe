"""How a network does on its training motions: declared here, measured by tasks/training_windows.py."""

from __future__ import annotations

from benchmarks.metric import Metric


def _training(name: str, unit: str, title: str, definition: str, of: str = "answer") -> Metric:
    return Metric(
        name=f"train/{name}", unit=unit, title=title, definition=definition, table="training",
        lower_is_better=True, of=of,
    )  # fmt: skip


METRICS = (
    _training(
        "window",
        "J",
        "In windows",
        "the training's own loss over windows that start as in training, mean per frame",
    ),
    _training("roll_out", "J", "In roll-outs", "the same over the same frames of whole roll-outs"),
    _training(
        "high_windows", "1", "High windows", "windows above the recipe's limit once the training had settled"
    ),
    _training("step", "ms", "Step", "time of a training step", "machine"),
)
