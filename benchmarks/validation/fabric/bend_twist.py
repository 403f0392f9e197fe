"""Bend-twist: a curved strip hangs in its own plane until its weight bends and twists it out.

The test of Miller, Lazarus, Audoly and Reis (2014, doi 10.1103/PhysRevLett.112.068103) by which Romero et al.
2021 validate rods: one of natural curvature kappa hangs from a clamp, its tangent downwards there, and is
planar or not, by kappa L and Gamma = w L^3 / B, w its weight per length. Here it is a strip cut from a flat
sheet along an arc. On edge it is as good as rigid, so that its shape in the plane is the arc itself:
theta = kappa s from the vertical, s from the clamp. A rotation phi about the tangent and psi about the normal
twists and bends it by

    tau = phi' - kappa psi,   beta = psi' + kappa phi,   phi = psi = 0 at the clamp

and to second order changes the energy by half of (Kirchhoff's rod; lengths over L, energies over B / L)

    integral of  C/B tau^2 + beta^2 + M (psi tau - phi beta)
                 + Gamma (1 - s) (psi^2 cos theta + phi psi sin theta)
    with M = -Gamma times the integral from s to 1 of (1 - r) sin theta(r) dr

the moment on edge. The arc gives way at the smallest Gamma where this vanishes for some phi and psi. A
straight strip that is clamped horizontally has Gamma = 12.85 (C/B)^(1/2).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh

from benchmarks.meshes import ROW, in_space, rectangle
from benchmarks.validation.equilibrium import DeadLoad, demand_converged
from benchmarks.validation.large_bending import (
    BUCKLING_MATERIAL,
    BUCKLING_ROWS,
    BUCKLING_STIFFNESS,
    buckling_factor,
)
from benchmarks.validation.plates import NU
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.minimise.minimisers import minimise
from reference_sim.potential import Potential

BENDING, TWIST = (
    BUCKLING_STIFFNESS / 4 * (1 - NU**2),
    BUCKLING_STIFFNESS / 2 * (1 - NU),
)  # EI and GJ of a narrow strip, over its width [J]
RIGID = replace(BUCKLING_MATERIAL, young_modulus=100 * BUCKLING_MATERIAL.young_modulus)  # on edge
PUSH, RESOLVED = 0.02, 0.03  # out of the plane at the start, over the square of the distance; of a weight
DEGREE, POINTS = 16, 60  # of the polynomials; of Gauss's quadrature


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
    phi, psi = (np.kron(which, shape.T).T for which in ([[1.0, 0.0]], [[0.0, 1.0]]))
    tau = np.kron([[1.0, 0.0]], slope.T).T - curvature * psi
    beta = np.kron([[0.0, 1.0]], slope.T).T + curvature * phi

    def integral(one: np.ndarray, other: np.ndarray, factor: np.ndarray | float = 1.0) -> np.ndarray:
        return (one * weights * factor) @ other.T

    elastic = stiffness_ratio * integral(tau, tau) + integral(beta, beta)
    load = integral(psi, tau, moment) - integral(phi, beta, moment)
    load += integral(psi, psi, below * np.cos(theta)) + integral(phi, psi, below * np.sin(theta))
    largest = float(eigh(-(load + load.T) / 2, elastic, eigvals_only=True)[-1])
    return 1 / largest if largest > 1e-9 else np.inf


def hanging_arc(curvature: float) -> float:
    """Return the weight at which a simulated arc gives way, over that of the rod, by its kappa L.

    The free edges lack half a hinge, an error of first order in the cell: two meshes are extrapolated.
    """
    cloths = (arc(rows, curvature, 0.02) for rows in BUCKLING_ROWS)
    coarse, fine = (buckling_factor(cloth, _weight(cloth, curvature)) for cloth in cloths)
    return 2 * fine - coarse


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
