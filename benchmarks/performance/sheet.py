"""Microbenchmarks sheet/* and scaling/*: a sheet falling from two pinned corners, no contact."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from benchmarks.performance.microbenchmark import Settings
from benchmarks.process.memory import peak_memory
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge.definition import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk.definition import StretchStVK
from reference_sim.material import Material
from reference_sim.minimise.result import Result
from reference_sim.time_step import State, TimeStepper

FRAMES = 30
NEWTON = {"method": "newton"}
LBFGS = {"method": "lbfgs", "finish": False, "max_iterations": 30}  # alone, as many iterations at every size
SMALLEST = 32  # vertices a side: from there slopes are taken
DT = 1 / 30
NOISE = 1e-4  # [m] of the flat start, which would otherwise be a saddle


def regular_sheet(n: int) -> Cloth:
    """Return a 1 m square of n x n vertices, pinned at two corners."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    h = 1.0 / (n - 1)
    positions = np.stack([h * i.ravel(), np.zeros(n * n), h * j.ravel()], axis=1)
    a = (i[:-1, :-1] * n + j[:-1, :-1]).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n], 1), np.stack([a + 1, a + n + 1, a + n], 1)])
    return Cloth(positions, faces, Material(), pins=[0, n - 1])


def fall(cloth: Cloth, frames: int, **options: Any) -> list[tuple[Result, float]]:
    """Simulate the first frames from a flat start moved by noise; return result and seconds of each.

    options: of the minimiser. Raises ValueError where it diverges.
    """
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    stepper = TimeStepper(cloth, terms, dt=DT, **options)
    x = cloth.rest_positions + np.random.default_rng(0).normal(0, NOISE, cloth.rest_positions.shape)
    x[cloth.pins] = cloth.rest_positions[cloth.pins]
    state, steps = State(x, np.zeros_like(x)), []
    for frame in range(1, frames + 1):
        clock = time.perf_counter()
        after, (result,) = stepper.advance(frame, state, None)
        steps.append((result, time.perf_counter() - clock))
        if after is None:
            raise ValueError(f"the sheet diverged at frame {frame}: {result.reason}")
        state = after
    return steps


def frames(settings: Settings, *, side: int) -> dict[str, float]:
    """Return the time of a frame of side x side vertices and its split, medians over repeats.

    The linear solver is all factorisations and the solves of Newton's method. Solves within a compiled
    descent are outside: it has one clock for all that it does.
    """
    cloth = regular_sheet(side)
    fall(cloth, 1)  # compiles
    medians, worst, inside, outside, converged, gradient = [], [], [], [], [], 0.0
    for _ in range(settings.repeats):
        steps = fall(cloth, FRAMES)
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
    """Return the cost of an iteration over the first frames, by L-BFGS alone and by Newton's method."""
    smallest = regular_sheet(SMALLEST)
    iteration_seconds(smallest, LBFGS, 1, 1)  # compiles
    base = peak_memory()
    small = iteration_seconds(smallest, LBFGS, 1, settings.repeats)
    cloth = regular_sheet(side)
    lbfgs = iteration_seconds(cloth, LBFGS, 1, settings.repeats)
    memory = peak_memory() - base
    iteration_seconds(regular_sheet(4), NEWTON, 1, 1)
    newton = iteration_seconds(cloth, NEWTON, frames, settings.repeats)
    numbers = {
        "vertices": cloth.vertex_count,
        "iteration": 1e3 * newton,
        "iteration_per_vertex": 1e6 * newton / cloth.vertex_count,
        "lbfgs_iteration": 1e3 * lbfgs,
    }
    ratio = cloth.vertex_count / smallest.vertex_count
    if ratio > 1:
        numbers["lbfgs_slope"] = math.log(lbfgs / small) / math.log(ratio)
        numbers["lbfgs_memory"] = 1e3 * memory / cloth.vertex_count
    return numbers


def iteration_seconds(cloth: Cloth, options: dict[str, Any], frames: int, repeats: int) -> float:
    """Return the time of an iteration [s] over the first frames of the fall, median of repeats."""
    costs = []
    for _ in range(repeats):
        steps = fall(cloth, frames, **options)
        costs.append(sum(seconds for _, seconds in steps) / sum(result.iterations for result, _ in steps))
    return float(np.median(costs))
