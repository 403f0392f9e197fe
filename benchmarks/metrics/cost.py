"""Metrics of cost and of training data: cost/*, solver/*, training_distance/*.

Metrics training_distance/*: distance of each pose of a scene to the nearest that the network trained on.

Mixed training poses count. See snug.motion.motion.nearest_pose for the distance.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.metric import Measurements, Metric, RollOut
from snug.motion.motion import nearest_pose

if TYPE_CHECKING:
    from benchmarks.metric import RollOut


def _cost(name: str, unit: str, title: str, definition: str, table: str = "cost") -> Metric:
    return Metric(
        name=f"cost/{name}", unit=unit, title=title, definition=definition, table=table, lower_is_better=True,
        of="machine",
    )  # fmt: skip


def _size(name: str, unit: str, title: str, definition: str, **more: Any) -> Metric:
    return Metric(
        name=f"cost/{name}", unit=unit, title=title, definition=definition, of="method", **more
    )  # fmt: skip


COST_METRICS = (
    _cost("data", "s", "Data generation", "simulation of the training motions, settling included"),
    _cost("setup", "s", "Preprocessing", "what a training does before its first step"),
    _cost("train", "s", "Training", "wall time of the steps of the training"),
    _size("train_steps", "1", "Steps", "updates of the training"),
    _size("train_frames", "1", "Training frames", "frames that it learned from, augmented ones included"),
    _cost("frame", "ms", "Inference", "inference time: time of the whole run over the frames computed, "
          "one frame at a time on one thread; the median of repeated runs"),
    _cost("whole", "ms", "End to end", "the same and what the method takes as ready: features and joint "
          "transforms of a network, the posed body of a solver, made one frame at a time: from pose to world "
          "vertices"),
    _cost("frame_p50", "ms", "Median frame",
          "50 % of the frames take less inference time, each by its median run", ""),
    _cost("frame_p95", "ms", "Frame, p95",
          "95 % of the frames take less inference time, each by its median run"),
    _cost("frame_worst", "ms", "Slowest frame", "inference time of the slowest frame by its median run", ""),
    _cost("batch", "ms", "In batch", "time per frame and body of 16 bodies at once"),
    _cost("spread", "%", "Spread", "largest less smallest repeat, as a share of their median", ""),
    _size("memory", "MB", "Memory", "size of the network", table="cost", lower_is_better=True),
    _cost("peak", "MB", "Process", "most memory of the method's process until its run had ended"),
)  # fmt: skip


RELAXED_FIELD = "relaxed"  # the simulator's field of frames
RELAXED_METRICS = (
    Metric(
        name="solver/relaxed_frames",
        unit="frames",
        title="Relaxed",
        definition="frames with a step whose residual, or the round-off in it, is above the tolerance",
        lower_is_better=True,
    ),
)


def measure_relaxed(roll_out: RollOut) -> dict[str, float]:
    """Return the number of relaxed frames of a method that minimises to a tolerance, over all frames."""
    fields = roll_out.trajectory.frame_fields
    return {RELAXED_METRICS[0].name: float(fields[RELAXED_FIELD].sum())} if RELAXED_FIELD in fields else {}


DISTANCE = "angle to the nearest training pose, augmented ones included, mean over joints: "

_metric_training_distance = partial(Metric, unit="deg", table="training_distance")

TRAINING_DISTANCE_METRICS = (
    _metric_training_distance(name="training_distance/median", title="From training poses",
            definition=f"{DISTANCE}median over frames"),
    _metric_training_distance(name="training_distance/p95", title="95 % of frames below",
            definition=f"{DISTANCE}95th percentile of frames"),
)  # fmt: skip


def measure_training_distance(roll_out: RollOut) -> dict[str, float]:
    """Return median and 95th percentile of these distances over frames [degrees]."""
    dressed, known = roll_out.scene.dressed, roll_out.training_poses
    if dressed is None or known is None:
        return {}
    degrees = np.rad2deg(nearest_pose(dressed.motion.poses[roll_out.judged], known))
    return {
        "training_distance/median": float(np.median(degrees)),
        "training_distance/p95": float(np.percentile(degrees, 95)),
    }


RELAXED = Measurements("solver", RELAXED_METRICS, measure=measure_relaxed)

TRAINING_DISTANCE = Measurements(
    "training_distance", TRAINING_DISTANCE_METRICS, measure=measure_training_distance
)

COST = Measurements("cost", COST_METRICS)
