"""A membrane under the forces that make a chosen smooth surface its equilibrium.

    x(X, Y) = (1.15 X + 0.04 sin pi X sin pi Y, 1.1 Y + 0.05 X Y (1 - Y), 0.15 sin pi X sin pi Y)

The forces are those of the weak form, f_a = int P(grad x) grad phi_a, by quadrature of order 8 in scikit-fem,
and the border is held on the surface; what the mesh then makes of it may differ by the error of linear
triangles alone: h^2 in the mean square, h in the gradient.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import skfem

from benchmarks.meshes import in_space, jittered_patch
from benchmarks.validation.convergence import demand_converged, fitted_order
from benchmarks.validation.dead_load import DeadLoad
from benchmarks.validation.membrane.stvk_forms import strain, stress, virtual_work
from reference_sim.cloth import Cloth
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import Material
from reference_sim.minimise.minimisers import minimise
from reference_sim.potential import Potential

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


def order(of: str) -> float:
    """Return the order of the error of "positions", or of the deformation "gradient", in the mean square."""
    return fitted_order([_errors(cells)[of] for cells in CELLS], [1 / cells for cells in CELLS])


@cache
def _errors(cells: int) -> dict[str, float]:
    material = Material()
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
    cloth = Cloth(in_space(points), faces, material, pins=np.flatnonzero(border))
    potential = Potential([StretchStVK(cloth), DeadLoad(cloth, forces.assemble(basis)[numbers])])
    result = demand_converged(minimise(potential, surface(*points.T).T), "the membrane")
    state = np.zeros(basis.N)
    state[numbers.ravel()] = result.positions.ravel()
    field = basis.interpolate(state)
    forms = {"positions": position_error, "gradient": gradient_error}
    return {name: float(np.sqrt(form.assemble(basis, field=field))) for name, form in forms.items()}
