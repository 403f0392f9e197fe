"""Specimens of textile laboratories: the strip of ASTM D1388, option A, and the disc of Cusick's drapemeter.

The strip overhangs by twice its bending length; the angle of its chord, read against the elastica's
master curve (height over width against Gamma = rho_a g L^3 / D, Romero et al. 2021), gives the bending
length.

The disc is one of 30 cm that a plate of 18 cm holds at its middle (BS 5058, ISO 9073-9):

    DC = 100 (area of the shadow - plate) / (specimen - plate)   [%]

Only the ring that overhangs is meshed, by triangles that the map r = exp keeps equilateral: there hinges
are an isotropic plate of stiffness k/4 and Poisson's ratio -1/3 (see benchmarks.validation.plates).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.validation.clamped_strip import Strip, clamped_strip, solve_elastica
from fabrics import SCALED, SNUG, Fabric
from reference_sim import GRAVITY, Cloth, Material

BENDING_LENGTH, DRAPE = "fabric/bending_length", "fabric/drape_coefficient"
FAMILY = "union_jack"  # of the strip's triangles: symmetric
OVERHANG = 2.0  # over the bending length: there the chord hangs at 41.5 degrees, as ASTM D1388 asks
LEAST, MOST, POINTS = 1e-2, 3e3, 71  # Gamma of the table that bending lengths are read from
PLATE, SPECIMEN = 0.09, 0.15  # [m] radii
ROUGH = 1e-4  # [m] standard deviation of the heights at the start: flat, the ring balances on a symmetry
PIXELS = 1000  # of the shadow, along a side of 0.32 m
HALF = 0.16  # [m]


@cache
def master_curve() -> tuple[np.ndarray, np.ndarray]:
    """Return Gamma (n,) and the angle (n,) [rad] below the horizontal of the chord from clamp to tip."""
    gammas = np.geomspace(LEAST, MOST, POINTS)
    s, y = np.linspace(0, 1, 200), np.zeros((4, 200))
    angles = []
    for gamma in gammas:
        s, y = solve_elastica(gamma, 0.0, s, y)
        angles.append(np.arctan2(y[3, -1], y[2, -1]))
    return gammas, np.array(angles)


def bending_length(overhang: float, angle: float) -> float:
    """Return the bending length [m] of a strip of that overhang [m] whose chord hangs at `angle` [rad].

    The strip of ASTM D1388, whose overhang is twice its bending length, hangs at 41.5 degrees:

    >>> round(bending_length(0.040, np.radians(41.5)), 4)
    0.02

    Where the angle is outside the table, the nearest end of it is taken.
    """
    gammas, angles = master_curve()
    # Gamma is close to a multiple of tan(angle) at small angles: the quotient is smooth enough for a
    # line.
    quotient = np.interp(angle, angles, np.log(gammas / np.tan(angles)))
    return overhang / float(np.exp(quotient) * np.tan(np.clip(angle, angles[0], angles[-1]))) ** (1 / 3)


@dataclass(frozen=True)
class Cantilever(Strip):
    """Strip that overhangs, and tells its bending length."""

    @property
    def start(self) -> np.ndarray:
        """Positions (V, 3) [m] before it bends: flat."""
        return self.cloth.rest_positions

    def measure(self, x: np.ndarray) -> dict[str, float]:
        """Return the bending length [mm] that the angle of the chord means, at x (V, 3) [m]."""
        width, height = self.chord(x)
        return {BENDING_LENGTH: 1e3 * bending_length(self.length, float(np.arctan2(height, width)))}

    def error(self, x: np.ndarray) -> float:
        """Return how far the bending length at x (V, 3) [m] is from the exact one [%]."""
        exact = (self.stiffness / (self.cloth.material.areal_density * GRAVITY)) ** (1 / 3)
        return 100.0 * abs(self.measure(x)[BENDING_LENGTH] / (1e3 * exact) - 1.0)


def cantilever(fabric: Fabric, columns: int) -> Cantilever:
    """Return a strip of a fabric whose overhang is twice its bending length.

    Its membrane is SNUG's; k of its hinges is such that its plate stiffness is the fabric's rigidity.
    """
    length = OVERHANG * fabric.bending_length
    for _ in range(2):  # where the clamp acts scales with the cell, so the second strip is right
        trial = clamped_strip(FAMILY, columns, length, membrane(fabric, 1.0))
        length *= OVERHANG * fabric.bending_length / trial.length
    strip = clamped_strip(FAMILY, columns, length, membrane(fabric, fabric.rigidity / trial.stiffness))
    return Cantilever(**vars(strip))


def membrane(fabric: Fabric, bending_stiffness: float, factor: float = 1.0) -> Material:
    """Return the material of a fabric: SNUG's membrane times `factor`, k [J] of its hinges as given."""
    return Material(
        young_modulus=factor * SNUG.young_modulus, poisson_ratio=SNUG.poisson_ratio, thickness=SNUG.thickness,
        density=fabric.density / SNUG.thickness, bending_stiffness=bending_stiffness,
    )  # fmt: skip


@dataclass(frozen=True)
class Disc:
    """Specimen on its plate: the ring that overhangs, its two innermost circles pinned.

    Attributes:
        cloth: rest state, flat in the plane y = 0.
    """

    cloth: Cloth

    @property
    def start(self) -> np.ndarray:
        """Positions (V, 3) [m] before it drapes: flat but for heights of ROUGH, always the same."""
        x = self.cloth.rest_positions.copy()
        x[:, 1] += ROUGH * np.random.default_rng(0).normal(size=len(x)) * self.cloth.free
        return x

    def measure(self, x: np.ndarray) -> dict[str, float]:
        """Return the drape coefficient [%] at x (V, 3) [m]."""
        plate = np.pi * PLATE**2
        share = (shadow(x, self.cloth.faces) - plate) / (np.pi * SPECIMEN**2 - plate)
        return {DRAPE: 100.0 * share}

    def error(self, x: np.ndarray) -> None:
        """Return None: no exact drape is known."""


def disc(fabric: Fabric, rings: int, membrane_factor: float = 1.0) -> Disc:
    """Return a specimen of a fabric with so many rings of triangles that overhang.

    membrane_factor: times SNUG's membrane.
    """
    points, faces, pins = ring(rings)
    material = membrane(fabric, fabric.rigidity / SCALED, membrane_factor)
    return Disc(Cloth(points, faces, material, pins=pins))


def ring(rings: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the mesh of the ring: points (V, 3) [m], faces (F, 3) that look up, pinned vertices.

    Two circles are pinned; the edge of the plate lies half-way between them.
    """
    step = np.log(SPECIMEN / PLATE) / (rings + 0.5)
    around = round(2 * np.pi / (step * 2 / 3**0.5))
    circle, place = np.meshgrid(np.arange(rings + 2), np.arange(around), indexing="ij")
    angle = (place + circle % 2 / 2) * 2 * np.pi / around
    radius = PLATE * np.exp((circle - 0.5) * step)
    points = np.stack([radius * np.cos(angle), 0 * radius, -radius * np.sin(angle)], axis=-1).reshape(
        -1, 3
    )
    inner = np.arange(rings + 1)[:, None] * around
    one, other = np.arange(around), (np.arange(around) + 1) % around
    a, b = inner + one, inner + other  # neighbours on the inner circle, and those outside of them
    c, d = a + around, b + around
    odd = (np.arange(rings + 1) % 2 == 1)[:, None, None]
    first = np.where(odd, np.stack([a, c, d], -1), np.stack([a, c, b], -1))
    second = np.where(odd, np.stack([a, d, b], -1), np.stack([b, c, d], -1))
    faces = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])
    return points, faces, np.arange(2 * around)


def shadow(x: np.ndarray, faces: np.ndarray) -> float:
    """Return the area [m^2] of the shadow from above of a mesh x (V, 3) [m] and the plate, by pixels.

    Layers that cover each other count once. The error is that of pixels on the border, 0.05 % of the
    area.
    """
    pixel = 2 * HALF / PIXELS
    corners = (x[faces][:, :, [0, 2]] + HALF) / pixel - 0.5
    middle = np.arange(PIXELS) * pixel + pixel / 2 - HALF
    covered = middle[:, None] ** 2 + middle[None, :] ** 2 < PLATE**2
    for triangle in corners:
        low = np.maximum(np.ceil(triangle.min(axis=0)).astype(int), 0)
        high = np.minimum(np.floor(triangle.max(axis=0)).astype(int) + 1, PIXELS)
        if (high <= low).any():
            continue
        u, v = np.arange(low[0], high[0])[:, None], np.arange(low[1], high[1])[None, :]
        ends = np.roll(triangle, -1, axis=0)
        sides = [(q - p)[0] * (v - p[1]) - (q - p)[1] * (u - p[0]) for p, q in zip(triangle, ends)]
        inside = np.all([side >= 0 for side in sides], axis=0) | np.all(
            [side <= 0 for side in sides], axis=0
        )
        covered[low[0] : high[0], low[1] : high[1]] |= inside
    return float(covered.sum() * pixel**2)
