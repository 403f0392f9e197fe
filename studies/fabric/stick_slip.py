"""Stick-slip: a strip pressed on end against a floor sticks until the floor's friction is too weak.

The test of Sano, Yamaguchi and Wada (2017, doi 10.1103/PhysRevLett.118.178001), by which Romero et al.
2021 validate friction. A clamp holds the strip upright and is lowered by the strain e times its length L;
its tip stands on the floor below. Without weight the elastica is

    theta'' = -(N sin theta + T cos theta),   theta(0) = 0, theta'(1) = 0    (1)
    x = integral of sin theta = 0,            integral of cos theta = 1 - e

with theta from the downward vertical, s from the clamp over L, and N and T, the floor's force on the tip
upwards and aside, over D / L^2. It sticks as long as |T| / N <= mu. Aside the stiffness of the tip is
negative: once it slides, it needs ever more friction, and slips for good.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from benchmarks import known_answer
from benchmarks.validation.clamped_strip import Strip, clamped_strip
from benchmarks.validation.contact import box
from benchmarks.validation.equilibrium import demand_converged
from benchmarks.validation.large_bending import ELASTICA_MATERIAL
from curved_strips import hanging_along
from reference_sim import Obstacle, Potential, Trajectory, simulate
from reference_sim.energies import BendHinge, ContactFriction, ContactPenalty, StretchStVK
from specimens import FAMILY

COLUMNS = 60  # cells along the strip
CLAMPED_AND_HINGED = 4.4934  # tan k = k: the column's buckling load is k^2 D / L^2
HARD = 3.4e8  # [J/m^5]: the tip stands less than 1e-4 m deep in the margin
DT = 100.0  # [s]: inertia is nothing
SLIDING = 1e-6  # [m] of slip in a step from which on friction no longer grows
LOOSE = 1e-3  # [m] in a step: the tip slips for good
STEP = 2e-4  # of the strain, by which the clamp is lowered: in larger steps the solver leaps ahead
# Strain -> friction below which the tip slips: the elastica's, critical_friction.
STRAINS = {0.05: 0.1035, 0.1: 0.1528, 0.15: 0.1959, 0.2: 0.2378, 0.25: 0.2807}


@cache
def exact(strain: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return s (n,), (theta, theta', x, depth) (4, n), N and T of (1).

    Raises RuntimeError where scipy finds no solution.
    """
    s, k = np.linspace(0, 1, 100), CLAMPED_AND_HINGED
    theta = strain**0.5 * (1 - np.cos(k * s) - k * np.sin(k * s)) / 2  # the buckling mode
    y, forces = np.stack([theta, np.gradient(theta, s), 0 * s, s]), [k**2, 0.0]

    def slope(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        sine, cosine = np.sin(y[0]), np.cos(y[0])
        return np.stack([y[1], -(p[0] * sine + p[1] * cosine), sine, cosine])

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[2], a[3], b[1], b[2], b[3] - (1 - strain)])

    solution = solve_bvp(slope, ends, s, y, p=forces, tol=1e-8, max_nodes=20000)
    if not solution.success:
        raise RuntimeError(f"the pressed elastica could not be integrated: {solution.message}")
    return solution.x, solution.y, float(solution.p[0]), float(solution.p[1])


def critical_friction(strain: float) -> float:
    """Return the coefficient of friction below which the tip of (1) slips."""
    normal, aside = exact(strain)[2:]
    return abs(aside) / normal


def critical_strain(mu: float) -> float:
    """Return the strain above which the tip of (1) slips."""
    return float(brentq(lambda strain: critical_friction(strain) - mu, 0.01, 0.3, xtol=1e-8))


@known_answer(
    {f"stick_slip_ratio_{strain:g}": {"strain": strain} for strain in STRAINS},
    expected=1.0, tolerance=0.005, reason="60 cells: at most 0.0012",
)  # fmt: skip
def force_ratio(strain: float) -> float:
    """Return friction over pressure at the tip of a pressed strip that sticks, over the elastica's."""
    pressed = Pressed()
    x = demand_converged(
        pressed.lowered(strain, 2 * critical_friction(strain), 4), "the strip"
    ).positions[-1]
    aside, normal = pressed.floor_force(x)
    return float(abs(aside / normal) / critical_friction(pressed.strain(x)))


@known_answer(
    {f"stick_slip_breaks_loose_{strain:g}": {"mu": friction} for strain, friction in STRAINS.items()},
    expected=1.0, tolerance=0.005, reason="steps of 0.0002 of the strain",
)  # fmt: skip
def breaking_loose(mu: float) -> float:
    """Return the strain at which a simulated strip breaks loose, over the elastica's.

    Raises RuntimeError where it does not, or a step before does not converge.
    """
    pressed, critical = Pressed(), critical_strain(mu)
    frames = round(0.12 * critical / STEP)
    moved = pressed.lowered(critical - STEP * 0.85 * frames, mu, frames, STEP)
    tips = moved.positions[:, pressed.strip.tip, 0].mean(axis=1)
    loose = np.flatnonzero(np.abs(np.diff(tips)) > LOOSE)
    if not len(loose) or not moved.frame_fields["converged"][: loose[0] + 1].all():
        raise RuntimeError(f"the strip did not break loose in {frames} steps that converge")
    return float((pressed.strain(moved.positions[loose[0]]) + STEP / 2) / critical)


class Pressed:
    """Strip of 1 m upright over a floor, in the plane z = 0."""

    def __init__(self) -> None:
        self.strip: Strip = clamped_strip(FAMILY, COLUMNS, 1.0, ELASTICA_MATERIAL)
        self.energies = [StretchStVK(self.strip.cloth), BendHinge(self.strip.cloth)]

    def lowered(self, strain: float, mu: float, frames: int, step: float = 0.0) -> Trajectory:
        """Simulate from the elastica of that strain on, the clamp lowered by `step` in each frame."""
        strip = self.strip
        contact = ContactPenalty(strip.cloth, samples="vertices", stiffness=HARD)
        pressure = exact(strain)[2] * strip.stiffness / strip.length**2 * strip.width
        sink = np.sqrt(pressure / (3 * contact.stiffness[strip.tip].sum()))
        start = self._elastica(strain, contact.margin - sink)
        pins = start[strip.cloth.pins]
        return simulate(
            strip.cloth,
            [*self.energies, contact, ContactFriction(contact, coefficient=mu, speed=SLIDING / DT)],
            dt=DT,
            frames=frames,
            obstacle=Obstacle(*box()),
            start=start,
            velocity=(self._elastica(strain + step, contact.margin - sink) - start) / DT,
            pin_positions=lambda frame: pins - [0.0, frame * step * strip.length, 0.0],
            guess="extrapolated",
            tolerance=1e-6,
        )

    def _elastica(self, strain: float, tip: float) -> np.ndarray:
        """Return positions (V, 3) [m] on the elastica of that strain, its tip at height `tip` [m]."""
        s, (_, _, aside, depth) = exact(strain)[:2]
        x = hanging_along(self.strip, s, aside, depth)
        x[:, 1] += tip + self.strip.length * (1 - strain)
        return x

    def floor_force(self, x: np.ndarray) -> np.ndarray:
        """Return the floor's force on the tip aside and upwards (2,) [N], at rest at x (V, 3) [m]."""
        return Potential(self.energies).gradient(x)[self.strip.tip, :2].sum(axis=0)

    def strain(self, x: np.ndarray) -> float:
        """Return by how much the clamp is nearer to the tip than the strip is long, over its length."""
        strip = self.strip
        pins = strip.cloth.pins
        clamp = (x[pins, 1] + strip.cloth.rest_positions[pins, 0]).mean() - strip.clamp
        return float(1 - (clamp - x[strip.tip, 1].mean()) / strip.length)
