"""A membrane under the forces that make a chosen smooth surface its equilibrium.

    x(X, Y) = (1.15 X + 0.04 sin pi X sin pi Y, 1.1 Y + 0.05 X Y (1 - Y), 0.15 sin pi X sin pi Y)

The forces are those of the weak form, f_a = int P(grad x) grad phi_a, by quadrature of order 8 in scikit-fem,
and the border is held on the surface; what the mesh then makes of it may differ by the error of linear
triangles alone: h^2 in the mean square, h in the gradient.
"""

from __future__ import annotations

from functools import cache

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, jittered_patch
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged, fitted_order
from benchmarks.validation.dead_load import DeadLoad
from benchmarks.validation.shells.stvk_forms import strain, stress, virtual_work
from reference_sim import energies

CELLS = (8, 16, 32)


def surface(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return x (3, ...) [m] of material points."""
    bump = np.sin(np.pi * X) * np.sin(np.pi * Y)
    return np.stack([1.15 * X + 0.04 * bump, 1.1 * Y + 0.05 * X * Y * (1 - Y), 0.15 * bump])


def gradient(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return F = dx/dX (3, 2, ...)."""
    along = np.pi * np.cos(np.pi * X) * np.sin(np.pi * Y)
    across = np.pi * np.sin(np.pi * X) * np.cos(np.pi * Y)
    zero = np.zeros_like(X)
    return np.stack(
        [
            np.stack([1.15 + 0.04 * along, 0.04 * across]),
            np.stack([zero + 0.05 * Y * (1 - Y), 1.1 + 0.05 * X * (1 - 2 * Y)]),
            np.stack([0.15 * along, 0.15 * across]),
        ]
    )


LINEAR = "linear triangles; random meshes scatter the slope"


@known_answer(["manufactured_gradient_order"], expected=1.0, tolerance=0.1, reason=LINEAR)
@known_answer(["manufactured_order"], expected=2.0, tolerance=0.2, reason=LINEAR)
@cache
def orders() -> dict[str, float]:
    """Return the order in h of the error of positions or of the deformation gradient, in the mean square."""
    errors = [_errors(cells) for cells in CELLS]
    sizes = [1 / cells for cells in CELLS]
    return {name: fitted_order([e[name] for e in errors], sizes) for name in errors[0]}


def _errors(cells: int) -> dict[str, float]:
    import skfem

    material = sim.Material()
    points, faces = jittered_patch(cells)
    mesh = skfem.MeshTri(points.T.copy(), faces.T.copy())
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1(), 3), intorder=8)
    numbers = basis.nodal_dofs.T

    @skfem.LinearForm
    def forces(v, w):
        F = gradient(*w.x)
        return virtual_work(F, stress(strain(F), material), v.grad)

    @skfem.Functional
    def position_error(w):
        return ((w["field"] - surface(*w.x)) ** 2).sum(axis=0)

    @skfem.Functional
    def gradient_error(w):
        return ((w["field"].grad - gradient(*w.x)) ** 2).sum(axis=(0, 1))

    border = (np.abs(points - 0.5) > 0.5 - 1e-9).any(axis=1)
    cloth = sim.Cloth(in_space(points), faces, material, pins=np.flatnonzero(border))
    potential = sim.Potential([energies.StretchStVK(cloth), DeadLoad(cloth, forces.assemble(basis)[numbers])])
    result = demand_converged(sim.minimise(potential, surface(*points.T).T), "the membrane")
    state = np.zeros(basis.N)
    state[numbers.ravel()] = result.positions.ravel()
    field = basis.interpolate(state)
    forms = {"manufactured_order": position_error, "manufactured_gradient_order": gradient_error}
    return {name: float(np.sqrt(form.assemble(basis, field=field))) for name, form in forms.items()}
