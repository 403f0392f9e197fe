"""Known answers of contact: a sheet on a plane, a point that leaves a sphere, a strip over a cylinder."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import jittered_patch, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import COTTON, ends, flat_cloth, minimum, motion
from reference_sim import energies

if TYPE_CHECKING:
    from reference_sim.obstacle import Planes


@known_answer(expected=1.0, tolerance=1e-3, reason="the depth follows the load by a square root")
def penalty_depth() -> float:
    """Return the resting depth of a sheet in the margin of a plane, mean, over sqrt(rho_a g / (3 k)).

    A vertex of area a carries rho_a a g and is pushed by 3 k a depth^2: the area cancels.
    """
    from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS

    contact, x = _sheet_at_rest("vertices")
    exact = np.sqrt(COTTON.areal_density * sim.GRAVITY / (3 * DEFAULT_STIFFNESS))
    return float(((contact.margin - x[:, 1]) / exact).mean())


@known_answer(
    expected=3.0, tolerance=1e-12, reason="vertices, edges and faces carry it once each; round-off"
)
def contact_sampled_area() -> float:
    """Return the area of all contact samples of a sheet over its own: each kind carries it once."""
    contact = energies.ContactPenalty(flat_cloth(*jittered_patch(8)))
    return float(contact.sample_areas.sum())  # the sheet has unit area


@known_answer(expected=1.0, tolerance=2e-6, reason="the residual gradient that the solver may leave")
def contact_force_is_weight() -> float:
    """Return the total contact force over the weight of a sheet at rest on a plane, all samples on."""
    contact, x = _sheet_at_rest("all")
    upward = -contact.value_and_gradient(x)[1][:, 1].sum()
    return float(upward / (COTTON.areal_density * sim.GRAVITY))  # the sheet has unit area


def _sheet_at_rest(samples: str) -> tuple[energies.ContactPenalty, np.ndarray]:
    points, faces = jittered_patch(8)
    cloth = flat_cloth(points - 0.5, faces, lies=True)
    contact = energies.ContactPenalty(cloth, samples=samples)
    start = cloth.rest_positions + np.array([0.0, 0.002, 0.0])
    contact.prepare(energies.Step(start, np.zeros_like(start), start, 1 / 30, sim.Obstacle(*box())))
    return contact, minimum([energies.StretchStVK(cloth), energies.Gravity(cloth), contact], start)


def box() -> tuple[np.ndarray, np.ndarray]:
    """Return a closed box under the plane y = 0, 2 m to each side and 1 m deep; outward faces."""
    corners = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-1.0, 0.0) for z in (-2.0, 2.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    return corners, faces


RADIUS = 1.0  # [m] of the sphere
START = 0.3  # [rad] from the top
HARD = 1e11  # [J/m^5] of the sphere: the point stays at its resting depth
DRUM = 0.2  # [m] radius of the cylinder
SLACK = 0.1  # [m] of each end of the strip below the axis
PULL = 2.0  # [N/m] at its ends, about, so that it never hangs slack


class RoundBody:
    """Sphere about the origin, or (axis=2) cylinder about the z axis, of `radius` [m]; an exact `Obstacle`.

    It turns about z by `turn` [rad] a frame: its face has the turned unit vectors as corners, so that
    "barycentric" coordinates on it are the coordinates of a point in the frame that turns.
    """

    faces = np.array([[0, 1, 2]])

    def __init__(self, radius: float, axis: int | None = None, *, turn: float = 0.0) -> None:
        self.radius, self.turn = radius, turn
        self.keep = np.ones(3)
        if axis is not None:
            self.keep[axis] = 0.0

    def at(self, frame: int) -> np.ndarray:
        """Return the turned unit vectors of a frame, (3, 3)."""
        c, s = np.cos(frame * self.turn), np.sin(frame * self.turn)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def moves_beside(self, points: np.ndarray) -> bool:
        """Return that no pins ride on it: ends of a strip are held while the drum turns below."""
        return False

    def planes(
        self,
        points: np.ndarray,
        frame: int,
        rest_points: np.ndarray | None = None,
        *,
        margin: float | None = None,
    ) -> Planes:
        """Return tangent planes below points (S, 3) [m] in a frame, with places on the turning skin."""
        from reference_sim.obstacle import Planes

        radial = points * self.keep
        normals = radial / np.linalg.norm(radial, axis=1, keepdims=True)
        skin = points - radial + self.radius * normals
        return Planes(skin, normals, np.zeros(len(points), dtype=np.int64), skin @ self.at(frame).T)


@known_answer(expected=1.0, tolerance=2e-3, reason="second order in dt; the point's depth over R")
def leaving_point() -> float:
    """Return the cos theta at which a point leaves a sphere, over 2/3 cos theta_0, extrapolated in dt."""
    coarse, fine = _leaving(480), _leaving(960)
    return (2 * fine - coarse) / (2 / 3 * np.cos(START))


@cache
def _leaving(rate: int) -> float:
    """Return cos theta where the contact force reaches zero, with `rate` steps a second.

    The point is a triangle of 4 mm. It starts at rest, as deep in the margin as its weight presses it.
    """
    corners = (
        0.004 / 3**0.5 * np.array([[np.cos(a), 0.0, np.sin(a)] for a in 2 * np.pi / 3 * np.arange(3)])
    )
    cloth = sim.Cloth(corners, np.array([[0, 2, 1]]), COTTON)
    contact = energies.ContactPenalty(cloth, samples="vertices", stiffness=HARD)
    density = contact.stiffness[0] / contact.sample_areas[0]
    depth = np.sqrt(COTTON.areal_density * sim.GRAVITY * np.cos(START) / (3 * density))
    turn = RoundBody(RADIUS, turn=START).at(1)
    start = (corners + np.array([0.0, RADIUS, 0.0])) @ turn.T
    start *= (RADIUS + contact.margin - depth) / np.linalg.norm(start, axis=1, keepdims=True)
    body: Any = RoundBody(RADIUS)
    x = motion(
        cloth, [energies.StretchStVK(cloth), energies.Gravity(cloth), contact], dt=1 / rate,
        frames=round(1.2 * rate), obstacle=body, start=start, guess="extrapolated",
    )  # fmt: skip
    middle = x.mean(axis=1)
    cosine = middle[:, 1] / np.linalg.norm(middle, axis=1)
    outside = np.linalg.norm(x, axis=2) - RADIUS
    # The force, but for a factor.
    press = (np.maximum(contact.margin - outside, 0.0) ** 2).mean(axis=1)
    # The force falls to zero along a line in cos theta: follow it from where a tenth to a third is left.
    share = press / press[0]
    tail = np.flatnonzero((share > 0.1) & (share < 0.33))
    return float(np.polyval(np.polyfit(share[tail], cosine[tail], 2), 0.0))


@known_answer(expected=0.0, tolerance=5e-3, reason="120 cells, and one of contact at each end of the arc")
def drum_tension() -> float:
    """Return the worst error of the tension along a strip over a frictionless cylinder, over the mean."""
    tension, expected, _, _ = _strip_on_drum()
    return float(np.abs(tension - expected).max() / expected.mean())


@known_answer(expected=1.0, tolerance=2e-3, reason="120 cells; the strip's depth in the margin over R")
def drum_pressure() -> float:
    """Return the mean over the arc of contact pressure over (tension/R + w cos phi)."""
    _, _, pressure, expected = _strip_on_drum()
    return float((pressure / expected).mean())


def _strip_on_drum() -> tuple[np.ndarray, ...]:
    """Return tension [N/m] and pressure [N/m^2] along a strip whose ends are held: ours, exact, each.

    Without friction only weight changes the tension N along the strip: dN/ds = w dy/ds, and an arc of
    radius R under tension N presses with N/R + w cos phi, where phi is the angle from the top.
    """
    from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS

    cloth, points, x = strip_over_drum(120, DEFAULT_STIFFNESS)
    contact = energies.ContactPenalty(cloth, samples="vertices")
    body: Any = RoundBody(DRUM, axis=2)
    for _ in range(6):  # the planes follow the strip until both agree
        contact.prepare(energies.Step(x, np.zeros_like(x), x, 1 / 30, body))
        x = minimum([energies.StretchStVK(cloth), energies.Gravity(cloth), contact], x, tolerance=1e-9)
    weight = cloth.material.areal_density * sim.GRAVITY
    columns = len(np.unique(points[:, 0])) - 1
    grid = x.reshape(3, -1, 3).mean(axis=0)  # the middle line
    width, cell = np.ptp(points[:, 1]), np.ptp(points[:, 0]) / columns
    # Force through each cell from the forces on all vertices to its left: equilibrium by free-body cut.
    strain = energies.StretchStVK(cloth).value_and_gradient(x)[1].reshape(3, -1, 3).sum(axis=0)
    tension = np.linalg.norm(np.cumsum(strain, axis=0)[:-1], axis=1) / width
    middle = 0.5 * (grid[1:] + grid[:-1])
    expected = tension[0] + weight * (middle[:, 1] - middle[0, 1])
    push = -contact.value_and_gradient(x)[1].reshape(3, -1, 3).sum(axis=0)
    upper = grid[:, 1] > 0.15 * DRUM
    pressure = np.linalg.norm(push, axis=1)[upper] / (width * cell)
    radius = np.linalg.norm(grid[upper, :2], axis=1)
    inner = 0.5 * (tension[1:] + tension[:-1])[upper[1:-1]]
    return tension, expected, pressure, inner / radius + weight * grid[upper, 1] / radius


def strip_over_drum(columns: int, stiffness: float) -> tuple[sim.Cloth, np.ndarray, np.ndarray]:
    """Return a strip held at both ends, its points in the plane (V,2), and on the drum (V,3) [m].

    It is pulled by PULL, and its ends hang straight down. stiffness: of contact [J/m^5], by which it lies
    in the margin. The strip is a hundred times stiffer than cotton, as the exact formulas need no stretch.
    """
    from reference_sim.energies.contact_penalty import DEFAULT_MARGIN

    material = sim.Material(young_modulus=7e6, poisson_ratio=0.0)
    radius = DRUM + DEFAULT_MARGIN - np.sqrt(PULL / DRUM / (3 * stiffness))
    length = np.pi * radius + 2 * SLACK
    points, faces = right_grid(2, columns, 2 * length / columns, length)
    cloth = flat_cloth(points, faces, material, held=ends(points), lies=True)
    rest = cloth.rest_positions
    s = (rest[:, 0] - length / 2) * (1 + PULL / material.membrane_modulus)
    angle = np.clip(s / radius, -np.pi / 2, np.pi / 2)
    below = np.abs(s) - np.pi / 2 * radius
    x = np.stack([radius * np.sin(angle), radius * np.cos(angle), rest[:, 2]], axis=1)
    x[:, 1] -= np.maximum(below, 0.0)
    return cloth, points, x
