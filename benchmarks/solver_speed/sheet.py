"""The plain case: a sheet falling from two pinned corners, no contact."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from reference_sim import Cloth, Material, Potential, Result
from reference_sim.energies import BendHinge, Gravity, Inertia, Step, StretchStVK
from reference_sim.minimise import Minimiser, make_minimiser

from ..parts import Row

CASES = ("64 x 64",)
FRAMES = 30
DT = 1 / 30


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
    """Backward Euler from a flat start moved by 1e-4 m of noise; every step's Result and time is kept."""

    cloth: Cloth
    method: str = "newton"
    noise: float = 1e-4

    def __post_init__(self) -> None:
        cloth = self.cloth
        self.potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), Inertia(cloth, DT)])
        self.minimiser: Minimiser = make_minimiser(self.potential, self.method)
        self.x = cloth.rest_positions + np.random.default_rng(0).normal(
            0, self.noise, cloth.rest_positions.shape
        )
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


def measure(case: str, repeats: int) -> list[Row]:
    """ms a frame and the split of the time, medians over repeats."""
    cloth = regular_sheet(64)
    Fall(cloth).step()  # compiles
    medians, worst, inside, outside, converged, gradient = [], [], [], [], True, 0.0
    for _ in range(repeats):
        fall = Fall(cloth)
        frames = [fall.step() for _ in range(FRAMES)]
        seconds = [s for _, s in frames]
        linear = sum(r.seconds["factorise"] + r.seconds["solve"] for r, _ in frames)
        medians.append(np.median(seconds))
        worst.append(max(seconds))
        inside.append(linear)
        outside.append(sum(seconds) - linear)
        converged &= all(r.status == "converged" for r, _ in frames)
        gradient = max(gradient, *(r.gradient_norm for r, _ in frames))
    return [
        ("frame, median", 1e3 * float(np.median(medians)), "ms"),
        ("frame, worst", 1e3 * float(np.median(worst)), "ms"),
        ("every frame converged", str(converged), ""),
        ("largest gradient at the end", gradient, "mean vertex weights"),
        ("inside factorise and solve", float(np.median(inside)), "s"),
        ("outside factorise and solve", float(np.median(outside)), "s"),
        ("outside over inside", float(np.median(np.divide(outside, inside))), "1"),
    ]
