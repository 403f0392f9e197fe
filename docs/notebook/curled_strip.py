"""Stability of a hanging strip or rod of rest curvature in its plane: the numbers of fabric.md.

    OMP_NUM_THREADS=1 python docs/notebook/curled_strip.py

For each kappa L the weight Gamma grows from 0.1, and the planar shape is followed as far as there is one,
then back from 1000. It takes five seconds of CPU time and prints the smallest eigenvalue of the second
variation along the way, over that of torsion and bending without curvature or weight. A strip has C / B =
3 and is 1000 times as stiff on edge; a round, incompressible rod has C / B = 2/3 and the same stiffness
about both axes.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_bvp
from scipy.linalg import eigh

DEGREE, POINTS = 24, 120
BODIES = {"strip": (3.0, 1000.0), "round rod": (2 / 3, 1.0)}  # torsion, bending on edge, over B
GAMMAS = np.geomspace(0.1, 1000, 33)


def planar_shape(curvature: float, gamma: float, s: np.ndarray, y: np.ndarray):
    """Solve theta'' = Gamma (1 - s) sin theta, theta(0) = 0, theta'(1) = kappa L, from the shape y (2, n)."""
    return solve_bvp(
        lambda s, y: np.stack([y[1], gamma * (1 - s) * np.sin(y[0])]),
        lambda a, b: np.array([a[0], b[1] - curvature]), s, y, tol=1e-6, max_nodes=3000,
    )  # fmt: skip


def smallest(curvature: float, gamma: float, shape, torsion: float, edge: float) -> float:
    """Return the smallest eigenvalue of the second variation at a planar shape (curved_strips.py)."""
    z, weights = legendre.leggauss(POINTS)
    s, weights = (z + 1) / 2, weights / 2
    theta, kappa = shape.sol(s)
    moment, below = kappa - curvature, gamma * (1 - s)
    values = legendre.legvander(z, DEGREE - 1).T
    slopes = np.array([2 * legendre.legval(z, legendre.legder(p)) for p in np.eye(DEGREE)])
    value, slope = s * values, values + s * slopes
    phi, psi = np.concatenate([value, 0 * value]), np.concatenate([0 * value, value])
    phi_slope, psi_slope = np.concatenate([slope, 0 * slope]), np.concatenate([0 * slope, slope])
    tau, beta = phi_slope - kappa * psi, psi_slope + kappa * phi

    def integral(one, other, factor=1.0):
        product = (one * weights * factor) @ other.T
        return (product + product.T) / 2

    energy = torsion * integral(tau, tau) + edge * integral(beta, beta)
    energy += integral(psi, tau, moment) - integral(phi, beta, moment)
    energy += integral(psi, psi, below * np.cos(theta)) + integral(phi, psi, below * np.sin(theta))
    norm = torsion * integral(phi_slope, phi_slope) + integral(psi_slope, psi_slope)
    return float(eigh(energy, norm, eigvals_only=True, subset_by_index=[0, 0])[0])


if __name__ == "__main__":
    for curvature in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0):
        for way, start in (("up", curvature), ("down", 0.0)):
            s, eigenvalues = np.linspace(0, 1, 60), []
            y = np.stack([start * s, start + 0 * s])
            for gamma in GAMMAS if way == "up" else GAMMAS[::-1]:
                shape = planar_shape(curvature, gamma, s, y)
                if not shape.success:
                    break
                s, y = shape.x, shape.y
                eigenvalues.append(
                    (gamma, [smallest(curvature, gamma, shape, *body) for body in BODIES.values()])
                )
            if not eigenvalues:
                continue
            for which, body in enumerate(BODIES):
                least = min(values[which] for _, values in eigenvalues)
                below = [f"{gamma:.3g}" for gamma, values in eigenvalues if values[which] < 0]
                print(
                    f"kappa L {curvature:g}, {way} to Gamma {eigenvalues[-1][0]:.3g}, {body}:",
                    f"smallest {least:.3f}, negative at {', '.join(below) or 'none'}",
                )
