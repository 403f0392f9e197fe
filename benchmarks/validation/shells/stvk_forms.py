"""Strain and stress of St. Venant and Kirchhoff in the arrays of scikit-fem, for forms of the known answers.

    G = (F^T F - 1) / 2,   S = lambda tr(G) 1 + 2 mu G

F is (d, 2, ...), the gradient of the positions; G and S are (2, 2, ...). No code is shared with the energies
of the simulator, which the forms check.
"""

from __future__ import annotations

import numpy as np

import reference_sim as sim

IDENTITY = np.eye(2)[:, :, None, None]


def strain(F: np.ndarray) -> np.ndarray:
    """Return Green's strain G."""
    return 0.5 * (np.einsum("ia...,ib...->ab...", F, F) - IDENTITY)


def change_of_strain(F: np.ndarray, dF: np.ndarray) -> np.ndarray:
    """Return the change of G where F changes by dF, to first order."""
    half = np.einsum("ia...,ib...->ab...", F, dF)
    return 0.5 * (half + half.swapaxes(0, 1))


def stress(G: np.ndarray, material: sim.Material) -> np.ndarray:
    """Return the second Piola-Kirchhoff stress S [N/m] of a strain, or its change of a change of strain."""
    return material.lame_lambda * (G[0, 0] + G[1, 1]) * IDENTITY + 2 * material.lame_mu * G


def virtual_work(F: np.ndarray, S: np.ndarray, dF: np.ndarray) -> np.ndarray:
    """Return the work of S where F changes by dF."""
    return np.einsum("ia...,ab...,ib...->...", F, S, dF)
