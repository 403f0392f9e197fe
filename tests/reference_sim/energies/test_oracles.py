"""Energies against answers that share no code with them: scikit-fem's assembly, closed forms, symmetry."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, Functional, LinearForm, MeshTri

from reference_sim import Cloth, Material, Potential
from reference_sim.energies import BendHinge, Gravity, StretchSpring, StretchStVK
from tests.reference_sim.meshes import grid, patch, random_rotation

MATERIAL = Material()
LAM, MU = MATERIAL.lame_lambda, MATERIAL.lame_mu
FLAT, FACES = patch(21, cells=8)
TURN, SHIFT = random_rotation(1), np.array([0.3, -1.2, 0.8])


def turned_cloth(material: Material = MATERIAL) -> Cloth:
    """The unit square, unstructured, somewhere in space: the rest state of every test here."""
    return Cloth(FLAT @ TURN.T + SHIFT, FACES, material)


# Saint Venant-Kirchhoff in the notation of scikit-fem: the field x on the flat square, its gradient F.


def strain(F: np.ndarray) -> np.ndarray:
    return 0.5 * (np.einsum("ki...,kj...->ij...", F, F) - np.eye(2)[:, :, None, None])


def stress(G: np.ndarray) -> np.ndarray:
    return LAM * np.trace(G) * np.eye(2)[:, :, None, None] + 2 * MU * G


@Functional
def density(w):
    G = strain(w["x"].grad)
    return 0.5 * LAM * np.trace(G) ** 2 + MU * np.einsum("ij...,ij...", G, G)


@LinearForm
def force(v, w):
    F = w["x"].grad
    return np.einsum("ki...,ij...,kj...", F, stress(strain(F)), v.grad)


@BilinearForm
def stiffness(u, v, w):
    F = w["x"].grad
    change = np.einsum("ki...,kj...->ij...", F, u.grad)
    change = 0.5 * (change + change.transpose(1, 0, 2, 3))
    P = np.einsum("ki...,ij...->kj...", u.grad, stress(strain(F)))
    P += np.einsum("ki...,ij...->kj...", F, stress(change))
    return np.einsum("kj...,kj...", P, v.grad)


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


def test_membrane_is_that_of_scikit_fem(basis):
    x = FLAT @ np.diag([1.2, 0.9, 1.0]) @ random_rotation(2).T
    x += np.random.default_rng(3).normal(0, 0.03, x.shape)
    field = np.zeros(basis.N)
    field[basis.nodal_dofs.T.ravel()] = x.ravel()
    state = basis.interpolate(field)
    potential = Potential([StretchStVK(turned_cloth())])

    energy = density.assemble(basis, x=state)
    gradient = force.assemble(basis, x=state)[basis.nodal_dofs.T]
    hessian = in_mesh_order(stiffness.assemble(basis, x=state), basis)
    assert energy > 0.1 and np.abs(gradient).max() > 0.1 and np.abs(hessian).max() > 10
    # Two assemblies of the same sums in double precision: 1e-15 each, times a few hundred terms.
    assert potential.value(x) == pytest.approx(energy, rel=1e-13)
    assert np.abs(potential.gradient(x) - gradient).max() < 1e-13 * np.abs(gradient).max()
    assert np.abs(potential.hessian(x).toarray() - hessian).max() < 1e-13 * np.abs(hessian).max()


def test_collapsed_to_a_point_the_hessian_is_minus_the_laplacian(basis):
    """F = 0: no force, and negative curvature in every direction that is no translation."""
    potential = Potential([StretchStVK(turned_cloth())])
    x = np.tile([0.1, 0.2, 0.3], (len(FLAT), 1))
    K = in_mesh_order(laplacian.assemble(basis), basis)
    assert potential.gradient(x) == pytest.approx(0, abs=1e-15)
    assert np.abs(potential.hessian(x).toarray() + (LAM + MU) * K).max() < 1e-12 * (LAM + MU)


def test_masses_are_the_integrals_of_the_hat_functions(basis):
    @LinearForm
    def hat(v, _):
        return MATERIAL.areal_density * v[1]

    cloth = turned_cloth()
    masses = hat.assemble(basis)[basis.nodal_dofs[1]]
    assert cloth.masses == pytest.approx(masses, rel=1e-12)
    x = FLAT @ random_rotation(7)
    height = 1.5
    assert Potential([Gravity(cloth, origin_height=height)]).value(x) == pytest.approx(
        9.81 * masses @ (x[:, 1] - height), rel=1e-12
    )


def half_square(s: float) -> float:
    return (s**2 - 1) / 2


MODULUS = 4 * MU * (LAM + MU) / (LAM + 2 * MU)
POISSON = LAM / (LAM + 2 * MU)
STRETCH, SHEAR = 1.3, 0.4
STATES = {
    "uniaxial strain": (np.diag([STRETCH, 1.0]), (LAM / 2 + MU) * half_square(STRETCH) ** 2),
    "uniaxial strain, compressed": (np.diag([1.0, 0.6]), (LAM / 2 + MU) * half_square(0.6) ** 2),
    "uniaxial stress": (
        np.diag([STRETCH, (1 - POISSON * (STRETCH**2 - 1)) ** 0.5]),
        MODULUS * half_square(STRETCH) ** 2 / 2,
    ),
    "equibiaxial": (np.diag([STRETCH, STRETCH]), 2 * (LAM + MU) * half_square(STRETCH) ** 2),
    "simple shear": (
        np.array([[1, SHEAR], [0, 1]]),
        LAM * SHEAR**4 / 8 + MU * (SHEAR**2 / 2 + SHEAR**4 / 4),
    ),
    "collapse to a point": (np.zeros((2, 2)), (LAM + MU) / 2),
    "collapse to a line": (np.diag([1.0, 0.0]), (LAM / 2 + MU) / 4),
}


@pytest.mark.parametrize("name", STATES)
@pytest.mark.parametrize("seed", [4, 5])
def test_closed_forms_of_homogeneous_states(name, seed):
    """Per unit area; the square has area 1. What is left is round-off of positions 1.5 m from the origin."""
    state, expected = STATES[name]
    x = FLAT[:, :2] @ state.T @ random_rotation(seed)[:, :2].T - SHIFT
    assert Potential([StretchStVK(turned_cloth())]).value(x) == pytest.approx(expected, rel=1e-12)


def test_uniaxial_stress_is_in_equilibrium_across():
    """With the lateral stretch of uniaxial stress no force acts across: only the two pulled ends feel one."""
    state, _ = STATES["uniaxial stress"]
    x = np.column_stack([FLAT[:, :2] @ state.T, np.zeros(len(FLAT))])
    gradient = Potential([StretchStVK(turned_cloth())]).gradient(x)
    ends = (FLAT[:, 0] == 0) | (FLAT[:, 0] == 1)
    assert np.abs(gradient[~ends]).max() < 1e-12 and np.abs(gradient[:, 1:]).max() < 1e-12
    # Force on an end of unit width: first Piola stress s E2 G.
    pull = STRETCH * MODULUS * half_square(STRETCH)
    assert gradient[FLAT[:, 0] == 1, 0].sum() == pytest.approx(pull, rel=1e-12)


@pytest.mark.parametrize(("fold", "columns", "rows"), [(0.3, 5, 3), (-1.2, 3, 4)])
def test_a_sheet_folded_along_its_columns(fold, columns, rows):
    """Every inner column edge turns by the same angle and nothing else bends or stretches."""
    flat, faces = grid(columns, rows, width=0.1 * columns, depth=0.7)
    heading = fold * np.arange(columns)
    steps = 0.1 * np.stack([np.cos(heading), -np.sin(heading)], axis=1)
    profile = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    column = np.arange(len(flat)) // (rows + 1)
    x = np.column_stack([profile[column], flat[:, 2]]) @ TURN.T
    cloth = Cloth(flat, faces)
    exact = (columns - 1) * rows * MATERIAL.bending_stiffness / 2 * fold**2
    assert Potential([BendHinge(cloth, scaling="none")]).value(x) == pytest.approx(exact, rel=1e-12)
    assert Potential([StretchStVK(cloth)]).value(x) < 1e-25
    # Scaled: l^2 / (4 (A1 + A2)) with l = 0.7/rows and two triangles of 0.1 l / 2.
    length = 0.7 / rows
    scaled = exact * length**2 / (4 * 0.1 * length)
    assert Potential([BendHinge(cloth)]).value(x) == pytest.approx(scaled, rel=1e-12)


def curved_cloth() -> Cloth:
    x = 0.5 * FLAT
    return Cloth(x + np.column_stack([0 * x[:, :2], np.sin(4 * x[:, 0]) * x[:, 1] + x[:, 0] ** 2]), FACES)


def test_rest_turned_and_moved_has_no_energy_and_no_force():
    cloth = curved_cloth()
    x = cloth.rest_positions @ random_rotation(6).T + SHIFT
    for energy in (StretchStVK(cloth), StretchSpring(cloth), BendHinge(cloth, rest_angles="rest")):
        potential = Potential([energy])
        # Positions carry 1e-16 m; strains 1e-14; energies their square times 30 N/m.
        assert potential.value(x) < 1e-25
        assert np.abs(potential.gradient(x)).max() < 1e-12


def test_energies_do_not_see_rigid_motion_and_forces_turn_with_it():
    cloth = curved_cloth()
    x = cloth.rest_positions + np.random.default_rng(8).normal(0, 0.01, cloth.rest_positions.shape)
    turn = random_rotation(9)
    for energy in (StretchStVK(cloth), StretchSpring(cloth), BendHinge(cloth, rest_angles="rest")):
        potential = Potential([energy])
        value, gradient = potential.value_and_gradient(x)
        moved_value, moved_gradient = potential.value_and_gradient(x @ turn.T + SHIFT)
        assert value > 1e-6
        assert moved_value == pytest.approx(value, rel=1e-11)
        # Rounding of positions (1e-16 m at 1.5 m) times the stiffest hinge.
        assert np.abs(moved_gradient - gradient @ turn.T).max() < 1e-10 * np.abs(gradient).max()
        total, torque = gradient.sum(axis=0), np.cross(x, gradient).sum(axis=0)
        assert max(np.abs(total).max(), np.abs(torque).max()) < 1e-12 * np.abs(gradient).sum()


@pytest.mark.parametrize("scaling", ["none", "length_area"])
def test_membrane_and_hinges_leave_exactly_six_zero_modes(scaling):
    cloth = curved_cloth()
    x = cloth.rest_positions
    bending = BendHinge(cloth, scaling=scaling, rest_angles="rest")
    hessian = Potential([StretchStVK(cloth), bending]).hessian(x).toarray()
    values = np.linalg.eigvalsh(hessian)
    # Round-off of an eigenvalue is 1e-16 of the largest; the softest bending mode lies far above.
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > 1e-8 * values[-1]
    modes = [np.tile(axis, (len(x), 1)) for axis in np.eye(3)] + [np.cross(axis, x) for axis in np.eye(3)]
    for mode in modes:
        assert np.abs(hessian @ mode.ravel()).max() < 1e-12 * values[-1]


def test_flat_membrane_without_hinges_bends_for_nothing():
    """Out of plane a flat membrane at rest has no stiffness: one zero mode per vertex, and three in plane."""
    cloth = turned_cloth()
    values = np.linalg.eigvalsh(Potential([StretchStVK(cloth)]).hessian(cloth.rest_positions).toarray())
    zero = np.abs(values) < 1e-12 * values[-1]
    assert zero.sum() == cloth.vertex_count + 3
    assert values[~zero].min() > 1e-4 * values[-1]
