"""Metrics of cost: cost/* and solver/relaxed_frames.

Those of cost are taken from clocks, processes and trainings by benchmarks.runner.rows.
"""

from __future__ import annotations

from benchmarks.metric import Measurements, RollOut, metrics_of


def measure_relaxed(roll_out: RollOut) -> dict[str, float]:
    """Return the number of relaxed frames of a method that minimises to a tolerance, over all frames."""
    relaxed = roll_out.trajectory.frame_fields.get("relaxed")
    return {} if relaxed is None else {"solver/relaxed_frames": float(relaxed.sum())}


RELAXED = Measurements(
    "solver",
    metrics_of(
        ("solver/relaxed_frames", "frames", "Relaxed",
         "frames with a step whose residual, or the round-off in it, is above the tolerance"),
        lower_is_better=True,
    ),
    measure=measure_relaxed,
)  # fmt: skip
_SIZE = {"of": "method", "table": "", "lower_is_better": None}
COST = Measurements(
    "cost",
    metrics_of(
        ("cost/data", "s", "Data generation", "simulation of the training motions, settling included"),
        ("cost/setup", "s", "Preprocessing", "what a training does before its first step"),
        ("cost/train", "s", "Training", "wall time of the steps of the training"),
        ("cost/train_steps", "1", "Steps", "updates of the training", _SIZE),
        ("cost/train_frames", "1", "Training frames",
         "frames that it learned from, augmented ones included", _SIZE),
        ("cost/frame", "ms", "Inference",
         "inference time: run time divided by the number of frames, one frame at a time on one thread; "
         "median of repeated runs"),
        ("cost/whole", "ms", "End to end",
         "end-to-end time: inference and the preparation of its inputs, from pose to world vertices"),
        ("cost/frame_p50", "ms", "Median frame",
         "median of the inference times of single frames, each by its median run", {"table": ""}),
        ("cost/frame_p95", "ms", "Frame, p95",
         "95th percentile of the inference times of single frames, each by its median run"),
        ("cost/frame_worst", "ms", "Slowest frame",
         "inference time of the slowest frame, by its median run", {"table": ""}),
        ("cost/batch", "ms", "In batch", "time per frame and body of 16 bodies at once"),
        ("cost/spread", "%", "Spread",
         "largest less smallest repeat, as a share of their median", {"table": ""}),
        ("cost/memory", "MB", "Memory", "size of the network", {"of": "method"}),
        ("cost/peak", "MB", "Process", "most memory of the method's process until its run had ended"),
        table="cost", lower_is_better=True, of="machine",
    ),
)  # fmt: skip
