"""Do two minimisers agree, and how far apart may two right answers be: the same walk, several ways.

A step of wrinkled cloth has several minima, and a walk that takes another one goes on from there. So the
measure of agreement is what a start moved by less than anyone could see does to the same numbers, over
several directions and both signs of each; and step by step, both minimisers from one state, how often they
end in different minima.
"""

from __future__ import annotations

import numpy as np

from reference_sim import Potential, Trajectory
from reference_sim.energies import Inertia, Step
from reference_sim.minimise import LBFGS, Newton

from ..metrics.curvature import curvature_series
from ..parts import Row
from ..scene import BuiltScene
from .tshirt import dressed, walk

CASES = ("walk, 1000",)
TERMS = ("strain", "bending", "gravity", "inertia", "collision")
NAMES = (*(f"energy/{term}" for term in TERMS), "mean curvature")
DIRECTIONS = 5  # each of them with both signs
MOVED = 1e-4  # [m] root mean square over the vertices
SAME = 1e-6  # [m] two ends of one step closer than this are one minimum


def measure(case: str, repeats: int) -> list[Row]:
    """Energies, mean curvature and time of Newton, L-BFGS, and Newton from starts moved by 0.1 mm."""
    scene = dressed(case)
    for method in ("newton", "lbfgs"):
        walk(scene, frames=2, method=method)
    newton, lbfgs = walk(scene, method="newton"), walk(scene, method="lbfgs")
    moved = [walk(scene, start=start, method="newton") for start in moved_starts(scene.start)]
    rows: list[Row] = []
    for name in NAMES:
        rows += agreement(
            name, _number(newton, name), _number(lbfgs, name), [_number(m, name) for m in moved]
        )
    for label, run in (("Newton", newton), ("L-BFGS then Newton", lbfgs)):
        rows.append((f"{label}: frame, median", 1e3 * float(np.median(run.frame_seconds[1:])), "ms"))
        rows.append(
            (f"{label}: converged frames", f"{int(run.frame_fields['converged'].sum())} of {run.frames}", "")
        )
    distances = [np.linalg.norm(run.positions - newton.positions, axis=2).mean() for run in (lbfgs, *moved)]
    rows.append(("mean distance, L-BFGS to Newton", 1e3 * float(distances[0]), "mm"))
    rows.append(("mean distance, moved starts to Newton", 1e3 * float(np.mean(distances[1:])), "mm"))
    rows.append(("largest of them", 1e3 * float(np.max(distances[1:])), "mm"))
    return rows + step_by_step(scene, newton)


def moved_starts(start: np.ndarray) -> list[np.ndarray]:
    """2 DIRECTIONS starts (V, 3) [m], MOVED away from `start` in opposite pairs."""
    noise = np.random.default_rng(0).normal(0, MOVED / np.sqrt(3), (DIRECTIONS, *start.shape))
    return [start + sign * shift for shift in noise for sign in (1, -1)]


def agreement(name: str, newton: float, lbfgs: float, moved: list[float]) -> list[Row]:
    """The difference of two minimisers beside the differences that a moved start makes."""
    unit = "1/m" if name == "mean curvature" else "J"
    off = np.array(moved) - newton
    within = bool(off.min(initial=0.0) <= lbfgs - newton <= off.max(initial=0.0))
    return [
        (f"{name}: Newton", newton, unit),
        (f"{name}: L-BFGS minus Newton", lbfgs - newton, unit),
        (f"{name}: {len(moved)} moved starts, extremes", f"{off.min():+.2e} {off.max():+.2e}", unit),
        (f"{name}: moved starts, standard deviation", float(off.std(ddof=1)), unit),
        (f"{name}: L-BFGS within the extremes", str(within), ""),
    ]


def step_by_step(scene: BuiltScene, run: Trajectory) -> list[Row]:
    """Every step of `run` again by both minimisers, from the same state: do they find the same minimum?"""
    assert scene.obstacle is not None
    potential = Potential([*scene.energies, Inertia(scene.cloth, scene.dt)])
    newton, lbfgs = Newton(potential), LBFGS(potential)
    x, apart, higher = run.positions, [], []
    for frame in range(2, len(x)):
        previous, velocity = x[frame - 1], (x[frame - 1] - x[frame - 2]) / scene.dt
        guess = scene.obstacle.transported(previous, frame, scene.cloth.rest_positions)
        potential.prepare(Step(previous, velocity, guess, scene.dt, scene.obstacle, frame))
        ours, theirs = newton.minimise(guess), lbfgs.minimise(guess)
        apart.append(float(np.linalg.norm(ours.positions - theirs.positions, axis=1).max()))
        higher.append(theirs.energy - ours.energy)
    other = np.array(apart) > SAME
    same = float(np.max(np.array(apart)[~other], initial=0.0))
    steps = np.array(higher)[other]
    return [
        ("same step: other minimum", f"{int(other.sum())} of {len(apart)}", "steps"),
        (
            "same step: L-BFGS minus Newton there",
            f"{steps.min():+.1e} {steps.max():+.1e}" if len(steps) else "-",
            "J",
        ),
        ("same step, same minimum: largest distance", 1e3 * same, "mm"),
    ]


def _number(run: Trajectory, name: str) -> float:
    if name == "mean curvature":
        return float(curvature_series(run.positions, run.faces).means().mean())
    return float(np.nanmean(run.frame_fields[name]))
