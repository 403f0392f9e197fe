"""The plain case: a sheet falling from two pinned corners, no contact."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reference_sim import Cloth, Material, Potential, Result
from reference_sim.energies import BendHinge, Gravity, Inertia, Step, StretchStVK
from reference_sim.minimise import Minimiser, make_minimiser

from ..runner.memory import peak_memory
from .microbenchmark import Settings

FRAMES = 30
LBFGS = {"method": "lbfgs", "finish": False, "max_iterations": 30}  # alone, as many iterations at every size
SMALLEST = 32  # vertices a side: from there slopes are taken
DT = 1 / 30
NOISE = 1e-4  # [m] of the flat start, which would otherwise be a saddle


def regular_sheet(n: int) -> Cloth:
    """A 1 m square of n x n vertices, pinned at two corners."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    h = 1.0 / (n - 1)
    positions = np.stack([h * i.ravel(), np.zeros(n * n), h * j.ravel()], axis=1)
    a = (i[:-1, :-1] * n + j[:-1, :-1]).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n], 1), np.stack([a + 1, a + n + 1, a + n], 1)])
    return Cloth(positions, faces, Material(), pins=[0, n - 1])


@dataclass
class Fall:
    """Backward Euler from a flat start moved by noise; every step gives its Result and time."""

    cloth: Cloth
    options: Mapping[str, Any] = field(default_factory=dict)  # of the minimiser

    def __post_init__(self) -> None:
        cloth = self.cloth
        self.potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), Inertia(cloth, DT)])
        self.minimiser: Minimiser = make_minimiser(self.potential, **self.options)
        self.x = cloth.rest_positions + np.random.default_rng(0).normal(0, NOISE, cloth.rest_positions.shape)
        self.x[cloth.pins] = cloth.rest_positions[cloth.pins]
        self.v = np.zeros_like(self.x)

    def step(self) -> tuple[Result, float]:
        """One frame: its result and seconds."""
        clock = time.perf_counter()
        guess = self.x + DT * self.v
        self.potential.prepare(Step(self.x, self.v, guess, DT))
        result = self.minimiser.minimise(guess)
        seconds = time.perf_counter() - clock
        self.v, self.x = (result.positions - self.x) / DT, result.positions
        return result, seconds


def frames(settings: Settings, *, side: int) -> dict[str, float]:
    """A frame of side x side vertices and the split of its time, medians over repeats."""
    cloth = regular_sheet(side)
    Fall(cloth).step()  # compiles
    medians, worst, inside, outside, converged, gradient = [], [], [], [], [], 0.0
    for _ in range(settings.repeats):
        fall = Fall(cloth)
        steps = [fall.step() for _ in range(FRAMES)]
        seconds = [s for _, s in steps]
        linear = sum(r.seconds["factorise"] + r.seconds["solve"] for r, _ in steps)
        medians.append(np.median(seconds))
        worst.append(max(seconds))
        inside.append(linear)
        outside.append(sum(seconds) - linear)
        converged += [r.status == "converged" for r, _ in steps]
        gradient = max(gradient, *(r.gradient_norm for r, _ in steps))
    return {
        "vertices": cloth.vertex_count,
        "frame": 1e3 * float(np.median(medians)),
        "frame_worst": 1e3 * float(np.median(worst)),
        "converged_frames": 100.0 * float(np.mean(converged)),
        "gradient": gradient,
        "linear_solver": float(np.median(inside)),
        "outside_linear_solver": float(np.median(outside)),
        "outside_ratio": float(np.median(np.divide(outside, inside))),
    }


def scaling(settings: Settings, *, side: int, frames: int) -> dict[str, float]:
    """Cost of an iteration over the first frames of the fall, by L-BFGS alone and by Newton's method."""
    smallest = regular_sheet(SMALLEST)
    iteration_seconds(smallest, LBFGS, 1, 1)  # compiles
    base = peak_memory()
    small = iteration_seconds(smallest, LBFGS, 1, settings.repeats)
    cloth = regular_sheet(side)
    lbfgs = iteration_seconds(cloth, LBFGS, 1, settings.repeats)
    memory = peak_memory() - base
    iteration_seconds(regular_sheet(4), {}, 1, 1)
    newton = iteration_seconds(cloth, {}, frames, settings.repeats)
    found = {
        "vertices": cloth.vertex_count,
        "iteration": 1e3 * newton,
        "iteration_per_vertex": 1e6 * newton / cloth.vertex_count,
        "lbfgs_iteration": 1e3 * lbfgs,
    }
    ratio = cloth.vertex_count / smallest.vertex_count
    if ratio > 1:
        found["lbfgs_slope"] = math.log(lbfgs / small) / math.log(ratio)
        found["lbfgs_memory"] = 1e3 * memory / cloth.vertex_count
    return found


def iteration_seconds(cloth: Cloth, options: Mapping[str, Any], frames: int, repeats: int) -> float:
    """Time of an iteration [s] over the first frames of the fall; the median of repeats."""
    costs = []
    for _ in range(repeats):
        fall = Fall(cloth, options)
        steps = [fall.step() for _ in range(frames)]
        costs.append(sum(seconds for _, seconds in steps) / sum(result.iterations for result, _ in steps))
    return float(np.median(costs))
