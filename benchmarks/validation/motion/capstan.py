"""Capstan: a strip held at both ends over a drum that turns under it; the pulls differ by exp(mu phi).

Everything slips one way, and nothing moves any more once the tension has found its profile, so the friction
of each vertex is mu N on its own tangent. Where the strip turns by b at a vertex whose normal halves the
turn, forces along and across the tangent balance where

    (T2 - T1) cos(b/2) = mu N,    (T2 + T1) sin(b/2) = N,    T2/T1 = (1 + mu tan(b/2))/(1 - mu tan(b/2))

which over n turns of phi/n is exp(mu phi) (Euler, Eytelwein), but for mu (1 + mu^2) phi b^2/12 in its
logarithm. On a penalty the strip also sinks into the margin towards the tight end, against its normals.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

import reference_sim as sim
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged, fitted_order
from benchmarks.validation.motion.round_bodies import DRUM, RoundBody, strip_over_drum
from reference_sim import energies

if TYPE_CHECKING:
    from reference_sim.obstacle import Planes

HARD = 3.4e10  # [J/m^5]: the strip lies a hundredth as deep in the margin as on a body
TURN = 0.02  # [rad] of the drum in a step


class TurningDrum(RoundBody):
    """Cylinder about the z axis, turning by `turn` [rad] a step; its skin is known exactly.

    Its one face has the turned unit vectors as corners, so that "barycentric" coordinates on it are the
    coordinates of a point in the frame that turns.
    """

    faces = np.array([[0, 1, 2]])

    def __init__(self, radius: float, turn: float) -> None:
        super().__init__(radius, axis=2)
        self.turn = turn

    def at(self, frame: int) -> np.ndarray:
        """Return the turned unit vectors of a frame, (3, 3)."""
        c, s = np.cos(frame * self.turn), np.sin(frame * self.turn)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def planes(self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None) -> Planes:
        """Return tangent planes below points (S, 3) [m], with places on the turning skin."""
        tangent = super().planes(points, frame)
        return dataclasses.replace(tangent, barycentric=tangent.points @ self.at(frame).T)


@known_answer(
    {"friction_capstan_rough": {"mu": 0.5}, "friction_capstan_smooth": {"mu": 0.1}},
    expected=1.0, tolerance=1e-3, reason="60 cells: mu (1 + mu^2) phi b^2 / 12, at most 8e-4",
)  # fmt: skip
def ratio(mu: float) -> float:
    """Return the pulls on the ends of a strip over a turning drum, tight over slack, over exp(mu phi)."""
    return float(np.exp(_excess(mu, 60)))


@known_answer(expected=2.0, tolerance=0.2, reason="the strip's depth in the margin over R is left")
def friction_capstan_order() -> float:
    """Return the order in the length of a cell of the error of that ratio's logarithm, at mu = 0.5."""
    columns = (30, 60, 120)
    return fitted_order([abs(_excess(0.5, n)) for n in columns], [1 / n for n in columns])


def _excess(mu: float, columns: int) -> float:
    """Return the logarithm of the ratio of the pulls, less mu times the angle from first to last cell."""
    cloth, points, start = strip_over_drum(columns, HARD)
    ends = points[:, 0] < 1e-9, points[:, 0] > points[:, 0].max() - 1e-9
    contact = energies.ContactPenalty(cloth, samples="vertices", stiffness=HARD)
    friction = energies.ContactFriction(contact, coefficient=mu, speed=1e-3 * DRUM * TURN)
    body: Any = TurningDrum(DRUM, TURN)
    trajectory = sim.simulate(
        cloth,
        [energies.StretchStVK(cloth), contact, friction],
        dt=1.0,
        frames=40,
        obstacle=body,
        start=start,
        guess="previous",
        quasi_static=True,
        tolerance=1e-9,
    )
    x = demand_converged(trajectory, "the strip").positions[-1]
    strain = energies.StretchStVK(cloth).value_and_gradient(x)[1]
    pulls = [float(np.linalg.norm(strain[end].sum(axis=0))) for end in ends]
    line = x.reshape(3, columns + 1, 3).mean(axis=0)
    first, last = line[1] - line[0], line[-1] - line[-2]
    wrap = np.arccos(first @ last / np.linalg.norm(first) / np.linalg.norm(last))
    return float(np.log(max(pulls) / min(pulls)) - mu * wrap)
