"""Metrics dynamics/*: the hem of a method against the simulator's. Formulas stand in hem.py."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric
from benchmarks.metrics.motion.hem import AFTER, HemMotion, stop_frame
from benchmarks.metrics.surface.penetration_and_distances import rms
from snug.body.skeleton import rotation_matrices

if TYPE_CHECKING:
    from benchmarks.method import MethodEntry
    from benchmarks.metric import RollOut


def _dynamics(name: str, unit: str, title: str, definition: str, table: str = "dynamics") -> Metric:
    return Metric(name=f"dynamics/{name}", unit=unit, title=title, definition=definition, table=table)


COMMON = ("amplitude", "correlation", "gain", "lag")

METRICS = (
    _dynamics("quasi_static_difference", "mm", "From quasi-static",
              "root mean square distance to the method's own answer to each pose held still"),
    _dynamics("amplitude", "1", "Hem amplitude",
              "amplitude of the hem's dynamic part over that of the simulation's; the "
              "dynamic part is what motion adds to the own answer to poses held still"),
    _dynamics("correlation", "1", "Correlation", "cosine between the two dynamic parts"),
    _dynamics("gain", "1", "Gain", "factor by which the hem answers its own quasi-static turn or shift"),
    _dynamics("lag", "frames", "Lag", "frames by which it comes later"),
    *(_dynamics(f"common_{name}", "frames" if name == "lag" else "1", f"{title}, common",
                f"{title.lower()}, with every method's dynamic part taken from the simulator's answer to "
                "poses held still", table="dynamics" if name in COMMON[:2] else "")
      for name, title in zip(COMMON, ("Hem amplitude", "Correlation", "Gain", "Lag"))),
    _dynamics("ringing", "mm", "Ringing", "distance of the hem to where it ends, after the body has stopped"),
    *(_dynamics(f"ringing/{after}", "mm", f"Ringing, {after} frames",
                f"the same {after} frames after the stop", table="") for after in AFTER),
    _dynamics("spectrum", "1", "Spectrum", "difference of the hem's acceleration spectrum from the "
              "simulation's, as a share of the latter"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the distance to the quasi-static solution [mm] and, for the reference, its own dynamics."""
    x, group = roll_out.positions, roll_out.group
    static = group.quasi_static if roll_out is group.reference else roll_out.quasi_static
    values: dict[str, float] = compare(roll_out, roll_out) if roll_out is group.reference else {}
    if static is not None:
        frames = roll_out.judged_beside(static)
        values["dynamics/quasi_static_difference"] = rms(x[frames], static[frames])
    return values


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return dynamics by the method's own quasi-static solution and, as common_*, by the simulator's.

    Without a quasi-static solution of its own the numbers are left out that it enters.
    """
    hem, x, static = reference.kept(hem_motion), roll_out.positions, roll_out.quasi_static
    if hem is None:
        return {}
    values: dict[str, float] = {}
    common = hem.measure(x)
    if static is None:
        shared = shares_quasi_static(roll_out.entry)
        values |= {n: v for n, v in common.items() if shared or n.removeprefix("dynamics/") not in COMMON}
    elif len(static) >= len(x) and np.isfinite(static).all():
        values |= hem.measure(x, static)
    return values | {f"dynamics/common_{name}": common[f"dynamics/{name}"] for name in COMMON
                    if f"dynamics/{name}" in common}  # fmt: skip


def shares_quasi_static(entry: MethodEntry) -> bool:
    """Return whether the simulation's quasi-static solution is the method's too, where it returns none.

    It is that of solvers that minimise the reference's potential from their last frame; not of another
    material, of a network, or of a method that says nothing of itself.
    """
    return entry.static_known and entry.role in ("reference", "reference-variant", "solver")


def series(roll_out: RollOut) -> dict[str, np.ndarray]:
    """Return curves of the hem to be drawn over time."""
    reference = roll_out.group.reference
    hem = None if reference is None else reference.kept(hem_motion)
    return {} if hem is None else hem.curves(roll_out.positions)


def hem_motion(reference: RollOut) -> HemMotion | None:
    """Return the frame of reference of the scene's hems; None without a body or a quasi-static solution."""
    group, dressed = reference.group, reference.scene.dressed
    if dressed is None or group.quasi_static is None:
        return None

    motion = dressed.motion
    return HemMotion(
        axes=rotation_matrices(motion.poses[:, 0]),
        origins=dressed.pelvis,
        stop=stop_frame(motion.poses, motion.translations),
        hem=dressed.garment.hem,
        simulated=reference.positions,
        quasi_static=group.quasi_static,
        dt=group.scene.dt,
        first=group.scene.warm_up,
    )
