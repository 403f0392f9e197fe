"""Metrics dynamics/*: does the hem move by itself, or only follow the pose? In the axes of the body's root.

A method's dynamic part is what motion adds to its own static answer:

    D(t, v) = x(t, v) - x_static(t, v),  less its mean over time for each hem vertex v

with x_static the simulator's quasi-static solution of the same frames for a solver, and for a network its
output once each pose has been held still.

    amplitude    rms D / rms D of the simulator
    correlation  <D, D_sim> / (|D| |D_sim|)
    gain, lag    g and l of the least-squares fit  s(t) = g s_static(t - l),  s the hem's yaw, or its
                 displacement where the static hem does not turn
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of
from benchmarks.metrics.penetration_and_distances import rms
from snug.body.skeleton import rotation_matrices

if TYPE_CHECKING:
    from benchmarks.method import MethodEntry
    from benchmarks.metric import RollOut

Array = np.ndarray

TURNING = np.deg2rad(5.0)  # rms static yaw from which on gain and lag are those of the yaw
SHIFTING = 5e-3  # [m] rms static displacement below which there is no gain
MAX_LAG = 12.0  # frames
SHORTEST = 8  # frames of which a motion can be said
NO_MOTION = 1e-6  # [m] rms of a dynamic part that is none
TITLES = ("Hem correlation", "Hem amplitude", "Gain", "Lag")
HEM = tuple(zip(("correlation", "amplitude", "gain", "lag"), TITLES))


def dynamic_part(moving: Array, static: Array) -> Array:
    """Return D (T,H,3) [m] of a hem and its quasi-static solution, both (T,H,3) in the root frame."""
    difference = moving - static
    return difference - difference.mean(axis=0)


def root_mean_square(part: Array) -> float:
    """Return the square root of the mean squared length of vectors (T,H,3)."""
    return float(np.sqrt((part**2).sum(axis=-1).mean()))


def amplitude(part: Array, reference: Array) -> float:
    """Return the rms of D (T,H,3) over that of the reference's; nan where the reference has none."""
    reference_rms = root_mean_square(reference)
    return root_mean_square(part) / reference_rms if reference_rms >= NO_MOTION else float("nan")


def correlation(part: Array, reference: Array) -> float:
    """Return the cosine between D (T,H,3) and the reference's, as vectors; nan where one is zero."""
    if min(root_mean_square(part), root_mean_square(reference)) < NO_MOTION:
        return float("nan")
    return float(np.vdot(part, reference) / (np.linalg.norm(part) * np.linalg.norm(reference)))


def hem_yaw(hem: Array, axes: Array) -> Array:
    """Return the turn (T,) [rad] of a hem about the vertical since frame 0: best rotation of its shape.

    hem: (T,H,3) in the root's axes; axes: (T,3,3) root to world.
    """
    world = np.einsum("tij,tvj->tvi", axes, hem)
    # z, x: the yaw is positive from z to x.
    flat = (world - world.mean(axis=1, keepdims=True))[..., [2, 0]]
    z = flat[..., 0] + 1j * flat[..., 1]
    # The rotation about the centroid nearest to frame 0's shape in the sense of least squares.
    return np.unwrap(np.angle((z * z[0].conj()).sum(axis=1)))


def gain_and_lag(moving: Array, static: Array) -> tuple[float, float]:
    """Return g and l [frames] for which g static(t - l) fits moving(t), both (T,) less their means.

    Lags within MAX_LAG are tried in hundredths of a frame by linear interpolation; before its first frame
    a signal rests. Where no lag has a gain above 0, as of a hem that rests, the gain is 0 and the lag
    nan.
    """
    frames = np.arange(len(static), dtype=np.float64)
    moving = moving - moving.mean()
    best = (np.inf, 0.0, float("nan"))
    for lag in np.arange(-100 * MAX_LAG, 100 * MAX_LAG + 1) / 100:
        shifted = np.interp(frames - lag, frames, static)
        shifted = shifted - shifted.mean()
        power = float(shifted @ shifted)
        if power == 0:
            continue
        gain = float(moving @ shifted) / power
        error = float(((moving - gain * shifted) ** 2).sum())
        if gain > 0 and error < best[0]:
            best = (error, gain, float(lag))
    return best[1], best[2]


def response(moving: Array, static: Array, axes: Array) -> tuple[float, float]:
    """Return gain and lag [frames] of a hem (T,H,3) to its quasi-static one; nan where that rests."""
    turn = hem_yaw(static, axes)
    if turn.std() >= TURNING:
        return gain_and_lag(hem_yaw(moving, axes), turn)
    centre = static.mean(axis=1)
    centre = centre - centre.mean(axis=0)
    if np.sqrt((centre**2).sum(axis=1).mean()) < SHIFTING:
        return float("nan"), float("nan")
    along = np.linalg.svd(centre, full_matrices=False)[2][0]
    return gain_and_lag(moving.mean(axis=1) @ along, centre @ along)


@dataclass(frozen=True)
class HemMotion:
    """Frame of reference of dynamics: the body's root, and the simulator's two answers."""

    axes: Array  # (T,3,3) root to world
    origins: Array  # (T,3) [m]
    hem: Array  # (H,) vertices
    simulated: Array  # (T,V,3) [m], world
    quasi_static: Array  # (T,V,3) [m], world
    first: int = 0  # evaluated frame

    def view_hem(self, positions: Array) -> Array:
        """Return the hem (T,H,3) [m] of positions (T,V,3) [m] in the axes of the root."""
        frames = len(positions)
        from_root = positions[:, self.hem] - self.origins[:frames, None]
        return np.einsum("tji,tvj->tvi", self.axes[:frames], from_root)

    def measure(self, positions: Array, static: Array | None = None) -> dict[str, float]:
        """Return dynamic metrics of positions (T,V,3), [1] or [frames]; undefined ones left out.

        static: (T,V,3), the method's own answer to poses held still; None takes the simulator's.
        """
        last = min(len(positions), len(self.simulated), len(self.quasi_static))
        if last - self.first < SHORTEST:
            return {}
        frames = slice(self.first, last)
        answers = (positions, self.simulated, self.quasi_static)
        moving, simulated, quiet = (self.view_hem(answer[:last])[frames] for answer in answers)
        rest = quiet if static is None else self.view_hem(static[:last])[frames]
        part, reference = dynamic_part(moving, rest), dynamic_part(simulated, quiet)
        gain, lag = response(moving, rest, self.axes[frames])
        values = (correlation(part, reference), amplitude(part, reference), gain, lag)
        return {f"dynamics/{name}": v for (name, _), v in zip(HEM, values) if np.isfinite(v)}


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the distance to the quasi-static solution [mm] and, for the reference, its own dynamics."""
    x, group = roll_out.positions, roll_out.group
    static = group.quasi_static if roll_out is group.reference else roll_out.quasi_static
    values: dict[str, float] = compare(roll_out, roll_out) if roll_out is group.reference else {}
    if static is not None:
        frames = roll_out.match_frames(static)
        values["dynamics/quasi_static_difference"] = rms(x[frames], static[frames])
    return values


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return dynamics by the method's own quasi-static solution and, as common_*, by the simulator's.

    Without a quasi-static solution of its own the numbers are left out that it enters.
    """
    hem, x, static = reference.get(hem_motion), roll_out.positions, roll_out.quasi_static
    if hem is None:
        return {}
    values: dict[str, float] = {}
    common = hem.measure(x)
    if static is None:
        values = common if shares_quasi_static(roll_out.entry) else {}
    elif len(static) >= len(x) and np.isfinite(static).all():
        values = hem.measure(x, static)
    return values | {name.replace("/", "/common_"): value for name, value in common.items()}


def shares_quasi_static(entry: MethodEntry) -> bool:
    """Return whether the simulation's quasi-static solution is the method's too, where it returns none.

    It is that of solvers that minimise the reference's potential from their last frame.
    """
    return entry.static_known and entry.role in ("reference", "reference-variant", "solver")


def hem_motion(reference: RollOut) -> HemMotion | None:
    """Return the frame of reference of the scene's hems; None without body or quasi-static solution."""
    group, dressed = reference.group, reference.scene.dressed
    if dressed is None or group.quasi_static is None:
        return None
    return HemMotion(
        axes=rotation_matrices(dressed.motion.poses[:, 0]),
        origins=dressed.pelvis,
        hem=dressed.garment.hem,
        simulated=reference.positions,
        quasi_static=group.quasi_static,
        first=group.scene.warm_up,
    )


DYNAMICS = Measurements(
    "dynamics",
    metrics_of(
        ("dynamics/quasi_static_difference", "mm", "From quasi-static",
         "root mean square distance of all vertices to the method's own quasi-static solution"),
        ("dynamics/correlation", "1", "Hem correlation",
         "cosine between the dynamic parts of method and simulation: the hem's motion in the axes of the "
         "root, less the method's own quasi-static solution, less each vertex's mean"),
        ("dynamics/amplitude", "1", "Hem amplitude",
         "root mean square of the hem's dynamic part, divided by the simulation's; says nothing without the "
         "correlation, an untrained network has one too"),
        ("dynamics/gain", "1", "Gain",
         "factor of the least-squares fit of the hem's turn (or shift) to that of its own quasi-static "
         "solution, dynamics/lag frames earlier"),
        ("dynamics/lag", "frames", "Lag",
         "frames by which the hem follows its own quasi-static solution, at most 12"),
        *((f"dynamics/common_{name}", "frames" if name == "lag" else "1", f"{title}, common",
           f"{title.lower()}, with every method's dynamic part taken from the simulator's answer to poses "
           "held still", {"table": "" if name in ("gain", "lag") else "dynamics"})
          for name, title in HEM),
        table="dynamics",
    ),
    measure=measure, compare=compare,
)  # fmt: skip
