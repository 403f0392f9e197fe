"""Order in dt of whole sheets: where backward Euler has its first order, and what it takes to see it.

The membrane is held against its exact motion. Elsewhere there is none, and the order is that of the distance
between the positions with dt and with dt/2: it is that of the distance to the limit, where there is a limit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import sheet, square_sheet
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged, fitted_order
from benchmarks.validation.motion.discrete_laws import HANGING, stretched_membrane
from benchmarks.validation.motion.round_bodies import RoundBody
from reference_sim import energies

if TYPE_CHECKING:
    from reference_sim.obstacle import Planes

VISCOSITY = 0.25  # [N s/m] of an edge: waves faster than about 100 rad/s do not swing
BALL = 0.1  # [m] radius


@known_answer(expected=1.0, tolerance=0.1, reason="backward Euler; its second order still shows at 1/3840 s")
def membrane_time_step_order() -> float:
    """Return the order in dt of a stretched membrane's lowest mode after 0.1 s, against A cos(omega t)."""
    amplitude, end = 1e-5, 0.1
    cloth, start, mode, omega2 = stretched_membrane(amplitude)
    exact = amplitude * np.cos(np.sqrt(omega2) * end) * mode
    steps = (96, 192, 384)
    ends = [_end(cloth, [energies.StretchStVK(cloth)], start, end, n, tolerance=1e-11) for n in steps]
    return fitted_order([float(np.linalg.norm(x[:, 2] - exact)) for x in ends], [end / n for n in steps])


@known_answer(expected=1.0, tolerance=0.15, reason="backward Euler; faster vibrations still show at 1/1920 s")
def swing_time_step_order() -> float:
    """Return the order in dt of a sheet that swings from its upper edge, from 20 degrees, after 0.25 s."""
    flat, faces = sheet((8, 6), (0.4, 0.3))
    upright = np.stack([flat[:, 2], -flat[:, 0], flat[:, 1]], axis=1)
    cloth = sim.Cloth(upright, faces, sim.Material(), pins=np.arange(7))
    terms = [energies.StretchStVK(cloth), energies.BendHinge(cloth), energies.Gravity(cloth)]
    hanging = demand_converged(sim.minimise(sim.Potential(terms), upright), "the hanging sheet").positions
    cosine, sine = np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20))
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    edge = upright[0] * [0, 1, 0]
    start = (hanging - edge) @ turn.T + edge
    return halving_order(lambda n: _end(cloth, terms, start, 0.25, n), (60, 120, 240, 480))


class MovingBall(RoundBody):
    """Ball whose centre is at `heights` (T,) [m] above the origin, frame by frame."""

    def __init__(self, heights: Sequence[float] | np.ndarray) -> None:
        super().__init__(BALL)
        self.heights = heights

    def planes(self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None) -> Planes:
        """Return tangent planes below points (S, 3) [m] in a frame."""
        centre = np.array([0.0, self.heights[min(frame, len(self.heights) - 1)], 0.0])
        tangent = super().planes(points - centre, frame)
        return dataclasses.replace(tangent, points=tangent.points + centre)


@known_answer(expected=1.0, tolerance=0.1, reason="backward Euler; its second order still shows at 1/1200 s")
def pressed_time_step_order() -> float:
    """Return the order in dt of a taut sheet that a ball, already in touch, is pressed into smoothly."""
    return halving_order(_pressed(), (30, 60, 120, 240))


def _pressed() -> Callable[[int], np.ndarray]:
    """Return a function: number of steps -> positions after 0.2 s, while the ball rises smoothly."""
    end = 0.2
    flat, faces = square_sheet(8, 0.4)
    border = np.flatnonzero((np.abs(flat[:, [0, 2]]) > 0.2 - 1e-9).any(axis=1))
    cloth = sim.Cloth(flat, faces, sim.Material(), pins=border)
    terms = [
        energies.StretchStVK(cloth),
        energies.BendHinge(cloth),
        energies.Gravity(cloth),
        energies.ContactPenalty(cloth),
    ]

    def height(t: np.ndarray) -> np.ndarray:
        return 0.02 * np.sin(2 * np.pi * t) ** 6 - 0.8 * BALL  # from rest, without a jolt

    def ball(n: int) -> Any:
        return MovingBall(height(np.linspace(0, end, n + 1)))

    tent = 1.1 * flat
    tent[:, 1] = 0.12 * np.maximum(0.2 - np.hypot(flat[:, 0], flat[:, 2]), 0.0)
    still: Any = MovingBall([-0.8 * BALL])
    # Contact planes follow the sheet until both agree.
    start = sim.simulate(
        cloth, terms, dt=1.0, frames=9, quasi_static=True, start=tent, obstacle=still, guess="previous"
    ).positions[-1]
    return lambda n: _end(cloth, terms, start, end, n, obstacle=ball(n), guess="extrapolated")


class Viscosity(energies.Energy):
    """Viscosity of an edge, E = c/(2 dt) |(x_j - x_i) - (x_j - x_i)_t|^2 [J], c times relative velocity."""

    name = "viscosity"

    def __init__(self, cloth: sim.Cloth) -> None:
        self.cloth, self.stencils = cloth, cloth.edges
        self.before, self.factor = np.zeros((len(cloth.edges), 3)), 0.0

    def prepare(self, step: energies.Step) -> None:
        """Remember the edges at the start of the step."""
        self.before = step.previous[self.stencils[:, 1]] - step.previous[self.stencils[:, 0]]
        self.factor = VISCOSITY / step.dt

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the energy [J] and its gradient (V, 3) [N]."""
        first, second = self.stencils.T
        change = x[second] - x[first] - self.before
        gradient = np.zeros_like(x)
        np.add.at(gradient, second, self.factor * change)
        np.add.at(gradient, first, -self.factor * change)
        return 0.5 * self.factor * float((change**2).sum()), gradient

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        """Return the Hessian of each edge, (E, 6, 6) [N/m]."""
        _, blocks = self.scalar_stiffness(x)
        return np.kron(blocks, np.eye(3))

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges and their blocks (E, 2, 2) [N/m], the same for all coordinates."""
        block = self.factor * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return np.arange(len(self.stencils)), np.broadcast_to(block, (len(self.stencils), 2, 2))


@known_answer(
    {"hanging_sheet_time_step_order": {"viscous": False}},
    reason="reported: its vibrations are too fast for the steps, so the first order does not show",
)
@known_answer(
    {"viscous_time_step_order": {"viscous": True}},
    expected=1.0, tolerance=0.1, reason="backward Euler; nothing swings too fast for the steps",
)  # fmt: skip
def hanging_sheet_order(viscous: bool) -> float:
    """Return the order in dt of a sheet held at two corners, wrinkled after 0.7 s."""
    from benchmarks.scenes import hanging_sheet

    scene = hanging_sheet.build(HANGING, sheet_cells=6, sheet_frames=22)
    terms = [*scene.energies, *([Viscosity(scene.cloth)] if viscous else [])]
    return halving_order(lambda n: _end(scene.cloth, terms, scene.start, 0.7, n), (42, 84, 168, 336))


def halving_order(end: Callable[[int], np.ndarray], steps: Sequence[int]) -> float:
    """Return the order of `end` (V,3) [m] over numbers of steps, each twice the one before."""
    ends = [end(n) for n in steps]
    return fitted_order([_distance(a, b) for a, b in pairwise(ends)], [1 / n for n in steps[:-1]])


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(((a - b) ** 2).sum(axis=1).mean()))


def _end(
    cloth: sim.Cloth, terms: Sequence[energies.Energy], start: np.ndarray, end: float, n: int, **options: Any
) -> np.ndarray:
    """Return positions (V,3) [m] after `end` [s] in n steps, from rest."""
    trajectory = sim.simulate(cloth, terms, dt=end / n, frames=n + 1, start=start, **options)
    return demand_converged(trajectory, "the simulation").positions[-1]
