"""Strip with a rest curvature about its width, hanging from a clamp: the planar side of bend-twist.

A round rod of natural curvature kappa leaves the plane at large kappa L and Gamma. A strip is curved about
its weak axis and as good as rigid about the other, and its shape in the plane is stable at every kappa L and
Gamma that docs/notebook/curled_strip.py tries. That shape is

    theta'' = Gamma (1 - s) sin theta,   theta(0) = 0, theta'(1) = kappa L

with theta from the downward vertical, s from the clamp over L, and Gamma = rho_a g L^3 / D.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.fabrics.strip import FAMILY, clamped_strip
from benchmarks.validation.equilibrium import demand_converged
from benchmarks.validation.large_bending import ELASTICA_MATERIAL
from reference_sim.energies.bend_hinge import BendHinge, dihedral_angles
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import GRAVITY
from reference_sim.minimise.minimisers import minimise
from reference_sim.potential import Potential

COLUMNS = (60, 120)  # cells along the strip
PUSH = 0.02  # [m] by which the start is out of the plane at the tip


@cache
def exact(curvature: float, gamma: float) -> np.ndarray:
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


def tip_distance(curvature: float, gamma: float) -> float:
    """Return the distance of the tip to the elastica's, over the length.

    The start is pushed out of the plane: what is left of that counts as distance too. The rest curvature
    begins half a cell from the clamp's hinges, an error of first order: two meshes are extrapolated.

    Args:
        curvature: kappa L.
        gamma: rho_a g L^3 / D.
    """
    coarse, fine = (_tip(curvature, gamma, columns) for columns in COLUMNS)
    aside, depth = exact(curvature, gamma)[1:, -1]
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
    start = strip.hanging_along(*exact(curvature, gamma))
    start[cloth.free, 2] += PUSH * ((flat[cloth.free, 0] - strip.clamp) / length) ** 2
    strength = (curvature**2 + gamma) * strip.stiffness / ELASTICA_MATERIAL.areal_density / GRAVITY
    rest = demand_converged(minimise(potential, start, tolerance=1e-6 * strength), "the curled strip")
    tip = rest.positions[strip.tip].mean(axis=0) - flat[strip.tip].mean(axis=0) * [0, 0, 1]
    return tip / length
