"""Metrics training_distance/*: distance of each pose of a scene to the nearest that the network trained on.

Mixed training poses count. See snug.motion.motion.nearest_pose for the distance.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric
from snug.motion.motion import nearest_pose

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

DISTANCE = "angle to the nearest training pose, augmented ones included, mean over joints: "

_metric = partial(Metric, unit="deg", table="training_distance")

METRICS = (
    _metric(name="training_distance/median", title="From training poses",
            definition=f"{DISTANCE}median over frames"),
    _metric(name="training_distance/p95", title="95 % of frames below",
            definition=f"{DISTANCE}95th percentile of frames"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return median and 95th percentile of these distances over frames [degrees]."""
    dressed, known = roll_out.scene.dressed, roll_out.training_poses
    if dressed is None or known is None:
        return {}
    degrees = np.rad2deg(nearest_pose(dressed.motion.poses[roll_out.judged], known))
    return {
        "training_distance/median": float(np.median(degrees)),
        "training_distance/p95": float(np.percentile(degrees, 95)),
    }
