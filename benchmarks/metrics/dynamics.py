"""The dynamic metrics of a dressed scene: the hem of a method beside those of the simulator. See hem.py."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..metric import Metric
from .geometry import rms
from .hem import AFTER, HemMotion, stop_frame

if TYPE_CHECKING:
    from ..metric import RollOut, SceneRollOuts


def _dynamics(name: str, unit: str, title: str, definition: str, table: str = "dynamics") -> Metric:
    return Metric(name=f"dynamics/{name}", unit=unit, title=title, definition=definition, table=table)


METRICS = (
    _dynamics("quasi_static_difference", "mm", "From quasi-static",
              "root mean square distance to the method's own answer to each pose held still"),
    _dynamics("amplitude", "1", "A", "amplitude of the hem's dynamic part over that of the simulation's; the "
              "dynamic part is what motion adds to the own answer to poses held still"),
    _dynamics("correlation", "1", "Correlation", "cosine between the two dynamic parts"),
    _dynamics("gain", "1", "Gain", "factor by which the hem answers its own quasi-static turn or shift"),
    _dynamics("lag", "frames", "Lag", "frames by which it comes later"),
    _dynamics("ringing", "mm", "Ringing", "distance of the hem to where it ends, after the body has stopped"),
    *(_dynamics(f"ringing/{after}", "mm", f"Ringing, {after} frames",
                f"the same {after} frames after the stop", table="") for after in AFTER),
    _dynamics("spectrum", "1", "Spectrum", "difference of the hem's acceleration spectrum from the "
              "simulation's, as a share of the latter"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    own, x = roll_out.quasi_static, roll_out.positions
    if roll_out is roll_out.group.reference:
        own = roll_out.group.quasi_static
    found = {}
    if own is not None:
        frames = min(len(x), len(own))
        found["dynamics/quasi_static_difference"] = rms(x[:frames], own[:frames])
    hem = roll_out.group.kept(hem_motion)
    if hem is not None and (own is None or (len(own) >= len(x) and np.isfinite(own).all())):
        found |= hem.measure(x, own)
    return found


def series(roll_out: RollOut) -> dict[str, np.ndarray]:
    hem = roll_out.group.kept(hem_motion)
    return {} if hem is None else hem.curves(roll_out.positions)


def hem_motion(group: SceneRollOuts) -> HemMotion | None:
    """What to measure hems of this scene in; None without a body, a hem, or the simulator's two answers."""
    dressed, reference = group.scene.dressed, group.reference
    if dressed is None or "hem" not in dressed.garment.loops:
        return None
    if reference is None or group.quasi_static is None:
        return None
    from snug.skeleton import rotation_matrices

    body, motion = dressed.body, dressed.motion
    return HemMotion(
        axes=rotation_matrices(motion.poses[:, 0]),
        origins=body.joints()[0] + motion.translations,
        stop=stop_frame(motion.poses, motion.translations),
        hem=dressed.garment.hem,
        simulated=reference.positions,
        quasi_static=group.quasi_static,
        dt=group.scene.dt,
    )
