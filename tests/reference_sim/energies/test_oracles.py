"""Energies against answers that share no code with them, beyond those of the suite `validation`.

Its cases hold the membrane to scikit-fem's assembly and to closed forms, folded hinges to theirs, and
both to rigid motions: `pytest tests/benchmarks/validation/test_validation.py` runs them.
"""

from __future__ import annotations

import numpy as np
import pytest
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, MeshTri

from reference_sim import Cloth, Material, Potential
from reference_sim.energies import StretchSpring, StretchStVK
from tests.reference_sim.meshes import patch, random_rotation

MATERIAL = Material()
LAM, MU = MATERIAL.lame_lambda, MATERIAL.lame_mu
FLAT, FACES = patch(21, cells=8)
TURN, SHIFT = random_rotation(1), np.array([0.3, -1.2, 0.8])


def turned_cloth(material: Material = MATERIAL) -> Cloth:
    """The unit square, unstructured, somewhere in space: the rest state of every test here."""
    return Cloth(FLAT @ TURN.T + SHIFT, FACES, material)


@BilinearForm
def laplacian(u, v, _):
    return np.einsum("ki...,ki...", u.grad, v.grad)


@pytest.fixture(scope="module")
def basis() -> Basis:
    mesh = MeshTri(FLAT[:, :2].T.copy(), FACES.T.copy())
    return Basis(mesh, ElementVector(ElementTriP1(), 3), intorder=2)


def in_mesh_order(matrix, basis: Basis) -> np.ndarray:
    """Dense, with scikit-fem's numbering undone: coordinates of a vertex side by side."""
    order = basis.nodal_dofs.T.ravel()
    return matrix.toarray()[np.ix_(order, order)]


def test_collapsed_to_a_point_the_hessian_is_minus_the_laplacian(basis):
    """F = 0: no force, and negative curvature in every direction that is no translation."""
    potential = Potential([StretchStVK(turned_cloth())])
    x = np.tile([0.1, 0.2, 0.3], (len(FLAT), 1))
    K = in_mesh_order(laplacian.assemble(basis), basis)
    assert potential.gradient(x) == pytest.approx(0, abs=1e-15)
    assert np.abs(potential.hessian(x).toarray() + (LAM + MU) * K).max() < 1e-12 * (LAM + MU)


def test_springs_do_not_see_rigid_motion_and_their_forces_turn_with_it():
    cloth, turn = turned_cloth(), random_rotation(9)
    springs = Potential([StretchSpring(cloth)])
    rest = cloth.rest_positions
    # Positions carry 1e-16 m; strains 1e-14; energies their square times 30 N/m.
    assert springs.value(rest @ turn.T + SHIFT) < 1e-25
    assert np.abs(springs.gradient(rest @ turn.T + SHIFT)).max() < 1e-12
    x = rest + np.random.default_rng(8).normal(0, 0.01, rest.shape)
    value, gradient = springs.value_and_gradient(x)
    moved_value, moved_gradient = springs.value_and_gradient(x @ turn.T + SHIFT)
    assert value > 1e-6 and moved_value == pytest.approx(value, rel=1e-11)
    assert np.abs(moved_gradient - gradient @ turn.T).max() < 1e-10 * np.abs(gradient).max()
    total, torque = gradient.sum(axis=0), np.cross(x, gradient).sum(axis=0)
    assert max(np.abs(total).max(), np.abs(torque).max()) < 1e-12 * np.abs(gradient).sum()


def test_springs_a_tenth_longer_have_the_energy_and_the_force_of_the_formula():
    """E = 15 N/m times the squares of 3, 4 and 5 cm; the force of a spring is 30 N/m times its stretch."""
    # One triangle with sides of 0.3, 0.4 and 0.5 m, its right angle at the origin.
    cloth = Cloth(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.4, 0.0]]), np.array([[0, 1, 2]]))
    value, gradient = StretchSpring(cloth).value_and_gradient(1.1 * cloth.rest_positions)
    assert value == pytest.approx(15 * (0.03**2 + 0.04**2 + 0.05**2), rel=1e-12)
    assert gradient[0] == pytest.approx([-30 * 0.03, -30 * 0.04, 0], rel=1e-12)
