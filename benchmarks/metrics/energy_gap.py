"""Metrics gap/*, step/* and gradient/norm: how far a frame is from the minimum of its own time step.

At frame t the step's objective is Phi(x) = inertia + all declared terms, with x_hat from the method's own
two previous frames and contact planes frozen at the step's initial guess x_0 (the same guess as the
simulator's: carried by the obstacle, else x + dt v). Phi* is the lowest value found by the simulator's
minimiser, L-BFGS and then Newton, from x_0 and from x_t itself. A step has several minima; y_t is the one
found from x_t, the one that lies below the frame. Over the judged frames

    gap        mean of Phi(x_t) - Phi* [J]
    local      mean of Phi(x_t) - Phi(y_t) [J]
    relative   gap / scale,  scale = mean of Phi(x_s) - Phi(x_r) over steps of the reference x_r
    refrozen   the local gap where planes are frozen at x_t: what depends on where they are frozen
    distance   mean of the root mean square distance of vertices between x_t and y_t [mm]
    curvature  mean of |H(x_t) - H(y_t)| by the areas of y_t [1/m]
    norm       mean of the largest component of grad Phi(x_t), in mean vertex weights

x_s is the garment skinned to the frame's pose or, where there is no body, the guess x_0. The scale is the
same for every method of a scene. Each method is judged from its own history: a small gap says that a step
was solved, not that the past was right.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Estimate, Measurements, metrics_of
from benchmarks.metrics.curvature import boundary_mask, mean_curvature
from benchmarks.metrics.energy import copy_terms, freeze_step
from benchmarks.metrics.penetration_and_distances import MM

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.metric import Faces, Floats, Positions, RollOut, SceneRollOuts, Vertices
    from benchmarks.scene import BuiltScene
    from reference_sim.potential import Potential

# of one minimisation: a limit by the clock would make a gap depend on how busy a machine is
ITERATIONS = 300
PRECISION = 0.1  # standard error of the gap, as a share of it
# Share of the scale: a standard error below it is small enough however small the gap is.
NEGLIGIBLE = 1e-6
MEANS = ("gap/energy", "gap/local", "gap/refrozen", "step/distance", "step/curvature", "gradient/norm")


def measure(roll_out: RollOut) -> dict[str, float | Estimate]:
    """Return gaps, one-step distances and the gradient left, of the sampled frames."""
    group = roll_out.group
    scale, values = group.get(gap_scale), roll_out.get(judge_steps).metrics()
    if scale is None or not values:
        return values
    gap = values["gap/energy"]
    assert isinstance(gap, Estimate)
    if scale > 0.0:
        values["gap/relative"] = Estimate(gap.value / scale, gap.uncertainty / scale)
    return values | ({"gap/scale": scale} if roll_out is group.reference else {})


def series(roll_out: RollOut) -> dict[str, NDArray[np.float32]]:
    """Return step/vertices (T,V) [mm]: distance of vertices to y_t; nan but in sampled frames."""
    away = roll_out.get(judge_steps).away
    values = np.full(roll_out.positions.shape[:2], np.nan, dtype=np.float32)
    for frame, distances in away.items():
        values[frame] = distances
    return {"step/vertices": values} if away else {}


def judge_steps(roll_out: RollOut) -> Optimality:
    """Solve the sampled steps of a roll-out again."""
    group = roll_out.group
    scale = group.get(gap_scale)
    return optimality(roll_out.scene, roll_out.positions, samples=group.gap_samples, scale=scale)


def gap_scale(group: SceneRollOuts) -> float | None:
    """Return the scale [J] of the scene; None without a reference that has an evaluated frame."""
    reference = group.reference
    frames = [] if reference is None else list(_pick_frames(group.scene, reference.positions))
    if reference is None or not frames:
        return None
    potential, bare = _potential(group.scene), group.scene.skinned
    above = []
    for frame in frames:
        guess = freeze_step(group.scene, potential, reference.positions, frame)
        start = guess if bare is None else np.ascontiguousarray(bare[frame])
        here = np.ascontiguousarray(reference.positions[frame])
        above.append(potential.value(start) - potential.value(here))
    return float(np.mean(above))


@dataclass
class Optimality:
    """Numbers of the sampled frames, of `frames` in all; gap/refrozen is of the first of them alone."""

    frames: int = 0
    values: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in MEANS})
    away: dict[int, Floats] = field(default_factory=dict)  # frame -> (V,) [mm] from y_t

    def estimate(self, values: list[float]) -> Estimate:
        """Return the mean and its standard error as a sample of the judged frames; 0 for all of them."""
        count = len(values)
        if count >= self.frames:
            return Estimate(float(np.mean(values)), 0.0)
        correction = 1.0 - count / self.frames  # for a finite population
        error = float(np.std(values, ddof=1)) * np.sqrt(correction / count) if count > 1 else float("nan")
        return Estimate(float(np.mean(values)), float(error))

    def metrics(self) -> dict[str, float | Estimate]:
        """Return gap/*, step/* and gradient/norm; empty without a frame."""
        if not self.values["gap/energy"]:
            return {}
        return {name: self.estimate(v) for name, v in self.values.items() if v}

    def precise(self, negligible: float) -> bool:
        """Return whether the standard error of the gap is small, or as small as `negligible` [J]."""
        gap = self.estimate(self.values["gap/energy"])
        return gap.uncertainty <= max(PRECISION * abs(gap.value), negligible)


def optimality(
    scene: BuiltScene, positions: Positions, *, samples: int, scale: float | None = None
) -> Optimality:
    """Solve the time steps of at least `samples` frames again, evenly spread, until the gap is precise.

    scale: [J] of the scene's gaps. All numbers are nan where a frame has no finite energy.
    """
    from reference_sim.minimise.descent import mean_weight
    from reference_sim.minimise.lbfgs import LBFGS  # loads numba

    # No scale serves where the reference lies above the first guess, or has no energy.
    negligible = NEGLIGIBLE * scale if scale is not None and scale > 0.0 else 0.0
    frames = _pick_frames(scene, positions)
    numbers, potential = Optimality(frames=len(frames)), _potential(scene)
    values = numbers.values
    solver = LBFGS(potential, max_iterations=ITERATIONS)
    inner = ~boundary_mask(scene.cloth.faces, scene.cloth.vertex_count)
    for frame in spread_evenly(frames):
        x = np.ascontiguousarray(positions[frame])
        guess = freeze_step(scene, potential, positions, frame)
        energy, gradient = potential.value_and_gradient(x)
        if not np.isfinite(energy):  # no gap to speak of, and no place for a minimiser to start
            numbers.values = {name: [np.nan] for name in ("gap/energy", "gap/local", "gradient/norm")}
            numbers.away = {}
            return numbers
        minimum = solver.minimise(x)
        # A guess that has no energy, as of a garment that collapsed a frame ago, leads nowhere.
        minima = (solver.minimise(guess).energy, minimum.energy, energy)
        best = min(e for e in minima if np.isfinite(e))
        values["gap/energy"].append(energy - best)
        values["gap/local"].append(energy - min(energy, minimum.energy))
        largest = float(np.abs(gradient[scene.cloth.free]).max())
        values["gradient/norm"].append(largest / mean_weight(potential))
        y = minimum.positions
        numbers.away[frame] = MM * np.linalg.norm(x - y, axis=1)
        values["step/distance"].append(float(np.sqrt((numbers.away[frame] ** 2).mean())))
        if inner.any():
            values["step/curvature"].append(_curvature_error(x, y, scene.cloth.faces, inner))
        if scene.obstacle is not None and len(values["gap/refrozen"]) < samples:
            freeze_step(scene, potential, positions, frame, guess=x)
            refrozen = potential.value(x)
            values["gap/refrozen"].append(refrozen - min(refrozen, solver.minimise(x).energy))
        if len(values["gap/energy"]) >= samples and numbers.precise(negligible):
            break
    return numbers


def _pick_frames(scene: BuiltScene, positions: Positions) -> range:
    """Return the evaluated frames; none where a frame is not one time step."""
    return range(scene.warm_up, len(positions) if scene.substeps == 1 else 0)


def _potential(scene: BuiltScene) -> Potential:
    from reference_sim.potential import Potential  # loads numba

    return Potential(copy_terms(scene))


def spread_evenly(frames: range) -> Iterator[int]:
    """Yield all of the frames, in an order whose every beginning is spread evenly: halves, quarters.

    >>> list(spread_evenly(range(2, 10)))
    [2, 6, 4, 8, 3, 7, 5, 9]
    """
    count = len(frames)
    bits = max(count - 1, 1).bit_length()
    for place in range(1 << bits):
        turned = int(f"{place:0{bits}b}"[::-1], 2)  # the bits in reverse: van der Corput's sequence
        if turned < count:
            yield frames[turned]


def _curvature_error(x: Vertices, y: Vertices, faces: Faces, inner: NDArray[np.bool_]) -> float:
    """Return the mean of |H(x) - H(y)| [1/m] over inner vertices, by the areas of y."""
    ours, _ = mean_curvature(x, faces)
    theirs, areas = mean_curvature(y, faces)
    return float(np.average(np.abs(ours - theirs)[inner], weights=areas[inner]))


GAP = Measurements(
    "optimality",
    metrics_of(
        ("gap/energy", "J", "Energy gap",
         "energy of a frame above the lowest minimum found of its own time step, mean over sampled frames"),
        ("gap/relative", "1", "Relative energy gap",
         "energy gap divided by gap/scale, which is the same for all methods of a scene"),
        ("gap/scale", "J", "Scale of the gap",
         "energy of the skinned garment (without a body: of the step's first guess) above the "
         "reference's, in the reference's time steps; mean over frames",
         {"table": "", "lower_is_better": None}),
        ("gap/local", "J", "Local gap",
         "energy of a frame above the minimum that a descent from this frame reaches, mean over frames",
         {"table": ""}),
        ("gap/refrozen", "J", "Refrozen gap",
         "as the local gap, with contact planes searched at the frame instead of the step's first guess"),
        ("step/distance", "mm", "One-step distance",
         "root mean square distance between a frame and the local minimum of its own time step, mean over "
         "frames"),
        ("step/curvature", "1/m", "One-step curvature error",
         "|H - H_min| between a frame and that minimum, mean by area and over frames"),
        ("gradient/norm", "1", "Gradient",
         "largest component of the gradient left in a step, in mean vertex weights"),
        table="speed", lower_is_better=True,
    ),
    measure=measure, series=series,
    suites=("speed",),  # each sampled frame is two minimisations or three
)  # fmt: skip
