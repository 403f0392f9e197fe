"""A hanging sheet, and what a minimum is: checked by other means than a minimiser's own."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from reference_sim import GRAVITY, Cloth, Potential, Result
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from tests.reference_sim.meshes import grid
from tests.reference_sim.test_potential import dense_sum

TOLERANCE = 1e-6  # relative residual, the default that a result promises


SHEET, FACES = grid(8, 8, width=0.5, depth=0.5)


def hanging() -> tuple[Potential, np.ndarray]:
    cloth = Cloth(SHEET, FACES, pins=[0, 8])
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]), SHEET


def gradient_by_torch(potential: Potential, x: np.ndarray) -> np.ndarray:
    """(V, 3) [N] from the definitions alone."""
    variable = torch.as_tensor(x).clone().requires_grad_(True)
    sum(energy.energy(variable).sum() for energy in potential.energies).backward()
    return variable.grad.numpy()


def free_hessian(potential: Potential, x: np.ndarray) -> np.ndarray:
    """Dense, over the free vertices, from the definitions alone."""
    rows = np.repeat(potential.cloth.free, 3)
    return dense_sum(potential.energies, x)[np.ix_(rows, rows)]


def assert_minimum(potential: Potential, x0: np.ndarray, result: Result) -> None:
    """Pins still, gradient small and no negative curvature, by another way than the minimiser's own."""
    x, pins = result.positions, potential.cloth.pins
    assert result.status == "converged", result.reason
    assert (x[pins] == x0[pins]).all() and np.isfinite(x).all()
    gradient = gradient_by_torch(potential, x)
    gradient[pins] = 0
    norm = np.abs(gradient).max() / (potential.cloth.masses.mean() * GRAVITY)
    assert norm <= TOLERANCE
    # The two gradients differ by round-off of forces of 1 N in vertices of 1e-3 N.
    assert result.gradient_norm == pytest.approx(norm, abs=1e-9)
    values = np.linalg.eigvalsh(free_hessian(potential, x))
    assert values[0] > -1e-10 * values[-1]
    assert result.energy == pytest.approx(potential.value(x), rel=1e-12, abs=1e-20)
    assert sum(result.terms.values()) == pytest.approx(result.energy, rel=1e-9, abs=1e-20)
