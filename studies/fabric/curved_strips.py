"""Curved strips that hang from a clamp: bend-twist, on edge, and curl, about their width.

Bend-twist. The test of Miller, Lazarus, Audoly and Reis (2014, doi 10.1103/PhysRevLett.112.068103) by
which Romero et al. 2021 validate rods: one of natural curvature kappa hangs from a clamp, its tangent
downwards there, and is planar or not, by kappa L and Gamma = w L^3 / B, w its weight per length. Here it
is a strip cut from a flat sheet along an arc. On edge it is as good as rigid, so that its shape in the
plane is the arc itself: theta = kappa s from the vertical, s from the clamp. A rotation phi about the
tangent and psi about the normal twists and bends it by

    tau = phi' - kappa psi,   beta = psi' + kappa phi,   phi = psi = 0 at the clamp

and to second order changes the energy by half of (Kirchhoff's rod; lengths over L, energies over B / L)

    integral of  C/B tau^2 + beta^2 + M (psi tau - phi beta)
                 + Gamma (1 - s) (psi^2 cos theta + phi psi sin theta)
    with M = -Gamma times the integral from s to 1 of (1 - r) sin theta(r) dr

the moment on edge. The arc gives way at the smallest Gamma where this vanishes for some phi and psi. A
straight strip that is clamped horizontally has Gamma = 12.85 (C/B)^(1/2).

Curl. A round rod of natural curvature kappa leaves the plane at large kappa L and Gamma. A strip that is
curved about its width is as good as rigid about the other axis, and its shape in the plane is stable at
every kappa L and Gamma that docs/notebook/curled_strip.py tries. That shape is

    theta'' = Gamma (1 - s) sin theta,   theta(0) = 0, theta'(1) = kappa L

with theta from the downward vertical, s from the clamp over L, and Gamma = rho_a g L^3 / D.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_bvp
from scipy.linalg import eigh

from benchmarks import known_answer
from benchmarks.meshes import ROW, in_space, rectangle
from benchmarks.validation.clamped_strip import Strip, clamped_strip
from benchmarks.validation.equilibrium import DeadLoad, demand_converged
from benchmarks.validation.large_bending import (
    BUCKLING_MATERIAL,
    BUCKLING_ROWS,
    BUCKLING_STIFFNESS,
    ELASTICA_MATERIAL,
    buckling_factor,
)
from benchmarks.validation.plates import NU
from reference_sim import GRAVITY, Cloth, Potential, minimise
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from reference_sim.energies.bend_hinge import dihedral_angles
from specimens import FAMILY

# EI and GJ of a narrow strip, over its width [J].
BENDING, TWIST = BUCKLING_STIFFNESS / 4 * (1 - NU**2), BUCKLING_STIFFNESS / 2 * (1 - NU)
RIGID = replace(BUCKLING_MATERIAL, young_modulus=100 * BUCKLING_MATERIAL.young_modulus)  # on edge
PUSH, RESOLVED = 0.02, 0.03  # out of the plane at the start, over the square of the distance; of a weight
DEGREE, POINTS = 16, 60  # of the polynomials; of Gauss's quadrature
# kappa L -> Gamma at which an arc on edge gives way, C / B = 3: Kirchhoff's rod, critical_gamma.
ARCS = {1.0: 146.4, 2.0: 50.5, 3.0: 30.9, 4.0: 24.6, 5.0: 23.6, 6.0: 26.1}
CURLS = ((1.0, 1.0), (3.0, 1.0), (3.0, 10.0), (5.0, 1.0), (5.0, 100.0))  # kappa L, Gamma
COLUMNS = (60, 120)  # cells along a strip that curls
ASIDE = 0.02  # [m] by which its start is out of the plane at the tip


# --- bend-twist --------------------------------------------------------------------------------------------


def critical_gamma(curvature: float, stiffness_ratio: float, clamp: float = 0.0) -> float:
    """Return Gamma at which the arc gives way, inf where no weight bends it out of its plane.

    Args:
        curvature: kappa L.
        stiffness_ratio: C / B, that of torsion over that of bending out of the plane.
        clamp: angle [rad] between the tangent at the clamp and the downward vertical.

    >>> round(critical_gamma(0.0, 1.0, clamp=np.pi / 2), 2)
    12.85
    """
    z, weights = legendre.leggauss(POINTS)
    s, weights = (z + 1) / 2, weights / 2
    theta, below = clamp + curvature * s, 1 - s
    r = s[:, None] + below[:, None] * s
    moment = -below * (((1 - r) * np.sin(clamp + curvature * r)) @ weights)
    polynomials = np.eye(DEGREE)
    values = np.array([legendre.legval(z, p) for p in polynomials])
    slopes = np.array([2 * legendre.legval(z, legendre.legder(p)) for p in polynomials])
    shape, slope = s * values, values + s * slopes
    phi, psi = (np.kron(unit, shape.T).T for unit in ([[1.0, 0.0]], [[0.0, 1.0]]))
    tau = np.kron([[1.0, 0.0]], slope.T).T - curvature * psi
    beta = np.kron([[0.0, 1.0]], slope.T).T + curvature * phi

    def integral(one: np.ndarray, other: np.ndarray, factor: np.ndarray | float = 1.0) -> np.ndarray:
        return (one * weights * factor) @ other.T

    elastic = stiffness_ratio * integral(tau, tau) + integral(beta, beta)
    load = integral(psi, tau, moment) - integral(phi, beta, moment)
    load += integral(psi, psi, below * np.cos(theta)) + integral(phi, psi, below * np.sin(theta))
    largest = float(eigh(-(load + load.T) / 2, elastic, eigvals_only=True)[-1])
    return 1 / largest if largest > 1e-9 else np.inf


@known_answer(
    {f"bend_twist_arc_{curvature:g}": {"curvature": curvature} for curvature in ARCS},
    expected=1.0, tolerance=0.01, reason="two meshes extrapolated; width 2 % of the length, stiff on edge",
)  # fmt: skip
def hanging_arc(curvature: float) -> float:
    """Return the weight at which a simulated arc gives way, over that of the rod, by its kappa L.

    The free edges lack half a hinge, an error of first order in the cell: two meshes are extrapolated.
    """
    cloths = (arc(rows, curvature, 0.02) for rows in BUCKLING_ROWS)
    coarse, fine = (buckling_factor(cloth, _weight(cloth, curvature)) for cloth in cloths)
    return 2 * fine - coarse


@known_answer(
    {f"bend_twist_leaves_plane_{curvature:g}": {"curvature": curvature} for curvature in (1.0, 3.0, 5.0)},
    expected=1.0, tolerance=0.015, reason="planar at 0.985, out of its plane at 1.01",
)  # fmt: skip
def leaves_plane(curvature: float) -> float:
    """Return the weight from which on the minimiser takes an arc out of its plane, over that of its mesh.

    That of the mesh is where its tangent stiffness becomes singular; both sides of it are minimised.

    Raises RuntimeError where an arc does not come to rest.
    """
    cloth = arc(BUCKLING_ROWS[0], curvature, 0.04)
    weight = _weight(cloth, curvature)
    weight *= buckling_factor(cloth, weight)
    start = cloth.rest_positions.copy()
    start[cloth.free, 2] = PUSH * (start[cloth.free] ** 2).sum(axis=1)
    terms = [StretchStVK(cloth), BendHinge(cloth)]
    planar, out = 0.91, 1.11  # halved, it never meets 1, where the minimum is flat
    while out - planar > RESOLVED:
        factor = (planar + out) / 2
        result = minimise(Potential([*terms, DeadLoad(cloth, factor * weight)]), start, tolerance=1e-9)
        rest = demand_converged(result, f"the arc at {factor:.4f} of its weight").positions
        if np.abs(rest[:, 2]).max() > PUSH / 10:
            out = factor
        else:
            planar = factor
    return (planar + out) / 2


def _weight(cloth: Cloth, curvature: float) -> np.ndarray:
    """Return the dead load (V, 3) [N] at which the rod gives way."""
    weight = np.zeros_like(cloth.rest_positions)
    weight[:, 1] = -critical_gamma(curvature, TWIST / BENDING) * BENDING * cloth.vertex_areas
    return weight


def arc(rows: int, curvature: float, slender: float) -> Cloth:
    """Return an arc of length 1 m in the plane z = 0, clamped at the origin and heading downwards there.

    slender: its width over its length.
    """
    columns = round(rows * ROW / slender)
    h = 1 / (columns - 0.5)  # the clamp lies half-way between the two pinned columns
    points, faces = rectangle("equilateral", columns, rows, columns * h, rows * h * ROW)
    along, aside = (points - [h / 2, rows * h * ROW / 2]).T
    # exp is conformal: the triangles stay equilateral.
    radius = np.exp(curvature * aside) / curvature
    theta = curvature * along
    place = np.stack([1 / curvature - radius * np.cos(theta), -radius * np.sin(theta)], axis=1)
    return Cloth(in_space(place), faces, RIGID, pins=np.flatnonzero(along < 0.51 * h))


# --- curl --------------------------------------------------------------------------------------------------


def hanging_along(strip: Strip, s: np.ndarray, aside: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return positions (V, 3) [m] of a strip along a curve that begins downwards in the origin.

    Args:
        strip: to be hung.
        s: (n,) from where the clamp acts, over the length.
        aside: (n,) of the curve there, over the length.
        depth: (n,) the same downwards; above the clamp the strip is straight.
    """
    x = strip.cloth.rest_positions.copy()
    along = (x[:, 0] - strip.clamp) / strip.length
    x[:, 0] = strip.length * np.interp(along, s, aside)
    x[:, 1] = -strip.length * np.where(along > 0, np.interp(along, s, depth), along)
    return x


@cache
def exact_curl(curvature: float, gamma: float) -> np.ndarray:
    """Return s, the distance aside and the depth (3, n), over the length.

    Raises RuntimeError where scipy finds no solution.
    """

    def slope(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.stack([y[1], gamma * (1 - s) * np.sin(y[0]), np.sin(y[0]), np.cos(y[0])])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[2], a[3], b[1] - curvature])

    s = np.linspace(0, 1, 200)
    arc = np.stack([curvature * s, curvature + 0 * s, 1 - np.cos(curvature * s), np.sin(curvature * s)])
    arc[2:] /= curvature
    solution = solve_bvp(slope, ends, s, arc, tol=1e-8, max_nodes=20000)
    if not solution.success:
        raise RuntimeError(f"the curled elastica could not be integrated: {solution.message}")
    return np.concatenate([[solution.x], solution.y[2:]])


@known_answer(
    {f"bend_twist_curl_{curvature:g}_{gamma:g}": {"curvature": curvature, "gamma": gamma}
     for curvature, gamma in CURLS},
    expected=0.0, tolerance=0.002, reason="two meshes extrapolated",
)  # fmt: skip
def tip_distance(curvature: float, gamma: float) -> float:
    """Return the distance of a hanging, curled strip's tip to the planar elastica's, over the length.

    The start is pushed out of the plane: what is left of that counts as distance too. The rest curvature
    begins half a cell from the clamp's hinges, an error of first order: two meshes are extrapolated.

    Args:
        curvature: kappa L.
        gamma: rho_a g L^3 / D.
    """
    coarse, fine = (_tip(curvature, gamma, columns) for columns in COLUMNS)
    aside, depth = exact_curl(curvature, gamma)[1:, -1]
    return float(np.linalg.norm(2 * fine - coarse - [aside, -depth, 0.0]))


def _tip(curvature: float, gamma: float, columns: int) -> np.ndarray:
    """Return where the tip of the simulated strip comes to rest (3,), over the length."""
    strip = clamped_strip(FAMILY, columns, 1.0, ELASTICA_MATERIAL)
    cloth, length = strip.cloth, strip.length
    flat = cloth.rest_positions
    angle = curvature / length * flat[:, 0]
    rolled = np.stack([1 - np.cos(angle), -np.sin(angle), flat[:, 2] * curvature / length], axis=1)
    bend = BendHinge(cloth, rest_angles=dihedral_angles(rolled, cloth.hinges))
    acceleration = gamma * strip.stiffness / length**3 / ELASTICA_MATERIAL.areal_density
    potential = Potential([StretchStVK(cloth), bend, Gravity(cloth, acceleration=acceleration)])
    start = hanging_along(strip, *exact_curl(curvature, gamma))
    start[cloth.free, 2] += ASIDE * ((flat[cloth.free, 0] - strip.clamp) / length) ** 2
    strength = (curvature**2 + gamma) * strip.stiffness / ELASTICA_MATERIAL.areal_density / GRAVITY
    rest = demand_converged(minimise(potential, start, tolerance=1e-6 * strength), "the curled strip")
    tip = rest.positions[strip.tip].mean(axis=0) - flat[strip.tip].mean(axis=0) * [0, 0, 1]
    return tip / length
