"""Known answers of the membrane: closed forms, scikit-fem, a chosen equilibrium.

    G = (F^T F - 1) / 2,   S = lambda tr(G) 1 + 2 mu G

F is (d, 2, ...), the gradient of the positions; G and S are (2, 2, ...). No code is shared with the
energies.

Manufactured: forces that make x(X, Y) = (1.15 X + 0.04 b, 1.1 Y + 0.05 X Y (1 - Y), 0.15 b), b = sin pi X
sin pi Y, an equilibrium, f_a = int P(grad x) grad phi_a by quadrature of order 8. What the mesh makes of
it may differ by the error of linear triangles alone: h^2 in the mean square, h in the gradient.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, jittered_patch, random_rotation
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import COTTON, DeadLoad, border, fit_order, flat_cloth, minimum
from reference_sim import energies

IDENTITY = np.eye(2)[:, :, None, None]


def strain(F: np.ndarray) -> np.ndarray:
    """Return Green's strain G."""
    return 0.5 * (np.einsum("ia...,ib...->ab...", F, F) - IDENTITY)


def stress(G: np.ndarray) -> np.ndarray:
    """Return cotton's second Piola-Kirchhoff stress S [N/m], or its change, of a (change of) strain."""
    return COTTON.lame_lambda * (G[0, 0] + G[1, 1]) * IDENTITY + 2 * COTTON.lame_mu * G


def virtual_work(F: np.ndarray, S: np.ndarray, dF: np.ndarray) -> np.ndarray:
    """Return the work of S where F changes by dF."""
    return np.einsum("ia...,ab...,ib...->...", F, S, dF)


def vector_basis(points: np.ndarray, faces: np.ndarray, intorder: int) -> Any:
    """Return scikit-fem's linear triangles of positions in space, on points (V, 2) [m]."""
    import skfem

    mesh = skfem.MeshTri(points.T.copy(), faces.T.copy())
    return skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1(), 3), intorder=intorder)


STRETCH, SHEAR = 1.3, 0.4
NARROWED = COTTON.lame_lambda / (COTTON.lame_lambda + 2 * COTTON.lame_mu)  # nu2
# The lateral stretch of no stress.
UNIAXIAL = np.diag([STRETCH, np.sqrt(1 - NARROWED * (STRETCH**2 - 1))])


@known_answer(
    {
        f"membrane_{state.replace(' ', '_')}": {"state": state}
        for state in ("uniaxial strain", "uniaxial stress", "equibiaxial", "simple shear", "collapse")
    },
    expected=1.0, tolerance=1e-12, reason="round-off of some hundred triangles",
)  # fmt: skip
def closed_form(state: str) -> float:
    """Return the energy of a homogeneous state of a rotated, unstructured patch over its closed form."""
    cloth, points = _turn_patch()
    lam, mu = COTTON.lame_lambda, COTTON.lame_mu
    s, g, G = STRETCH, SHEAR, (STRETCH**2 - 1) / 2
    E2 = 4 * mu * (lam + mu) / (lam + 2 * mu)
    deformation, exact = {
        "uniaxial strain": (np.diag([s, 1.0]), (lam / 2 + mu) * G**2),
        "uniaxial stress": (UNIAXIAL, E2 * G**2 / 2),
        "equibiaxial": (np.diag([s, s]), 2 * (lam + mu) * G**2),
        "simple shear": (np.array([[1.0, g], [0.0, 1.0]]), lam * g**4 / 8 + mu * (g**2 / 2 + g**4 / 4)),
        "collapse": (np.zeros((2, 2)), (lam + mu) / 2),
    }[state]
    x = in_space(points @ deformation.T) @ random_rotation(2).T + [0.3, -2.0, 1.0]
    return energies.StretchStVK(cloth).value_and_gradient(x)[0] / exact  # the patch has unit area


def _turn_patch() -> tuple[sim.Cloth, np.ndarray]:
    points, faces = jittered_patch(8)
    return sim.Cloth(in_space(points) @ random_rotation(1).T, faces, COTTON), points


@known_answer(
    {"constant_bending_stiffness": {"name": "bending_stiffness", "printed": 3.96e-5}},
    unit="J", tolerance=5.1e-8, reason="three printed digits",
)  # fmt: skip
@known_answer(
    {
        "constant_lame_lambda": {"name": "lame_lambda", "printed": 20.9},
        "constant_lame_mu": {"name": "lame_mu", "printed": 11.1},
    },
    unit="N/m", tolerance=0.051, reason="three printed digits",
)  # fmt: skip
def constant(name: str, printed: float) -> tuple[float, float]:
    """Return the constant of the default cotton, and what the paper prints."""
    return float(getattr(COTTON, name)), printed


@known_answer(unit="N", expected=426.0 * 0.47e-3 * 9.81, tolerance=1e-12, reason="round-off")
def weight_of_a_square_metre() -> float:
    """Return the weight of a square metre of cotton: 426 kg/m^3 times 0.47 mm times 9.81 m/s^2."""
    cloth, _ = _turn_patch()
    return float(energies.Gravity(cloth).value_and_gradient(cloth.rest_positions)[1][:, 1].sum())


@known_answer(
    ["membrane_energy_scikit_fem", "membrane_gradient_scikit_fem", "membrane_hessian_scikit_fem"],
    expected=0.0, tolerance=1e-12, reason="round-off of two assemblies of the same sums",
)  # fmt: skip
@cache
def scikit_fem() -> dict[str, float]:
    """Return the relative difference to scikit-fem's energy, gradient, Hessian in a random state."""
    import skfem

    @skfem.Functional
    def energy(w):
        G = strain(w["x"].grad)
        return 0.5 * np.einsum("ab...,ab...->...", G, stress(G))

    @skfem.LinearForm
    def slope(v, w):
        F = w["x"].grad
        return virtual_work(F, stress(strain(F)), v.grad)

    @skfem.BilinearForm
    def hessian(u, v, w):
        F = w["x"].grad
        half = np.einsum("ia...,ib...->ab...", F, u.grad)
        geometric = virtual_work(u.grad, stress(strain(F)), v.grad)
        return geometric + virtual_work(F, stress(0.5 * (half + half.swapaxes(0, 1))), v.grad)

    points, faces = jittered_patch(12)
    x = in_space(points) @ random_rotation(4).T
    x += np.random.default_rng(5).normal(0, 0.03, x.shape)
    basis = vector_basis(points, faces, 2)
    order = basis.nodal_dofs.T.ravel()
    state = np.zeros(basis.N)
    state[order] = x.ravel()
    field = basis.interpolate(state)
    force = slope.assemble(basis, x=field)[order]
    matrix = hessian.assemble(basis, x=field).tocsr()[order][:, order]
    ours = sim.Potential([energies.StretchStVK(flat_cloth(points, faces))])
    gap = ours.gradient(x).ravel() - force
    change = (ours.hessian(x) - matrix).power(2).sum() / matrix.power(2).sum()
    return {
        "membrane_energy_scikit_fem": abs(ours.value(x) / float(energy.assemble(basis, x=field)) - 1),
        "membrane_gradient_scikit_fem": float(np.linalg.norm(gap) / np.linalg.norm(force)),
        "membrane_hessian_scikit_fem": float(np.sqrt(change)),
    }


@known_answer(
    unit="N", expected=0.0, tolerance=1e-11, reason="round-off of a membrane of 33 N/m moved by 4 m"
)
def rigid_motion_force() -> float:
    """Return the largest force in a flat patch after a rigid motion, hinges on."""
    potential, x = _move_patch()
    return float(np.abs(potential.gradient(x)).max())


@known_answer(expected=0.0, tolerance=1e-11, reason="round-off of positions some metres from the origin")
def rigid_invariance() -> float:
    """Return the relative change of the forces on a disordered patch under a rigid motion."""
    potential, x = _move_patch()
    x = x + np.random.default_rng(6).normal(0, 0.03, x.shape)
    turn = random_rotation(9)
    before, after = potential.gradient(x), potential.gradient(x @ turn.T + [0.5, -1.0, 2.0])
    return float(np.linalg.norm(after @ turn - before) / np.linalg.norm(before))


@known_answer(expected=6.0, tolerance=0.0, reason="three translations and three rotations, no other")
def rigid_zero_modes() -> float:
    """Return the number of zero eigenvalues of the Hessian of a flat patch, under 1e-9 of the largest."""
    potential, x = _move_patch()
    values = np.linalg.eigvalsh(potential.hessian(x).toarray())
    return float((np.abs(values) < 1e-9 * values[-1]).sum())


def _move_patch() -> tuple[sim.Potential, np.ndarray]:
    cloth = flat_cloth(*jittered_patch(5))
    potential = sim.Potential([energies.StretchStVK(cloth), energies.BendHinge(cloth)])
    return potential, cloth.rest_positions @ random_rotation(7).T + [1.0, 2.0, 3.0]


MANUFACTURED_CELLS = (8, 16, 32)


def surface(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return x (3, ...) [m] of material points."""
    bump = np.sin(np.pi * X) * np.sin(np.pi * Y)
    return np.stack([1.15 * X + 0.04 * bump, 1.1 * Y + 0.05 * X * Y * (1 - Y), 0.15 * bump])


def gradient(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return F = dx/dX (3, 2, ...)."""
    along = np.pi * np.cos(np.pi * X) * np.sin(np.pi * Y)
    across = np.pi * np.sin(np.pi * X) * np.cos(np.pi * Y)
    return np.array([
        [1.15 + 0.04 * along, 0.04 * across],
        [0.05 * Y * (1 - Y), 1.1 + 0.05 * X * (1 - 2 * Y)],
        [0.15 * along, 0.15 * across],
    ])  # fmt: skip


LINEAR = "linear triangles; random meshes scatter the slope"


@known_answer(["manufactured_gradient_order"], expected=1.0, tolerance=0.1, reason=LINEAR)
@known_answer(["manufactured_order"], expected=2.0, tolerance=0.2, reason=LINEAR)
@cache
def orders() -> dict[str, float]:
    """Return the order in h of the error of positions or of the deformation gradient, in the mean square."""
    errors = [_errors(cells) for cells in MANUFACTURED_CELLS]
    sizes = [1 / cells for cells in MANUFACTURED_CELLS]
    return {name: fit_order([e[name] for e in errors], sizes) for name in errors[0]}


def _errors(cells: int) -> dict[str, float]:
    import skfem

    points, faces = jittered_patch(cells)
    basis = vector_basis(points, faces, 8)
    numbers = basis.nodal_dofs.T

    @skfem.LinearForm
    def forces(v, w):
        F = gradient(*w.x)
        return virtual_work(F, stress(strain(F)), v.grad)

    @skfem.Functional
    def position_error(w):
        return ((w["field"] - surface(*w.x)) ** 2).sum(axis=0)

    @skfem.Functional
    def gradient_error(w):
        return ((w["field"].grad - gradient(*w.x)) ** 2).sum(axis=(0, 1))

    cloth = flat_cloth(points, faces, held=border(points))
    load = DeadLoad(cloth, forces.assemble(basis)[numbers])
    state = np.zeros(basis.N)
    state[numbers.ravel()] = minimum([energies.StretchStVK(cloth), load], surface(*points.T).T).ravel()
    field = basis.interpolate(state)
    forms = {"manufactured_order": position_error, "manufactured_gradient_order": gradient_error}
    return {name: float(np.sqrt(form.assemble(basis, field=field))) for name, form in forms.items()}
