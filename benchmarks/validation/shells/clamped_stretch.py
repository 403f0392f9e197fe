"""A square sheet pulled between two clamps, against quadratic triangles of scikit-fem.

The clamps hold the width, so the sheet necks: no closed form, but a smooth reference. Both are held in their
plane, here by a large hinge stiffness (flat hinges do no work), there by having two coordinates.
"""

from __future__ import annotations

from functools import cache

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, jittered_patch
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.shells.stvk_forms import change_of_strain, strain, stress, virtual_work
from reference_sim import energies

STRETCH = 1.2
MATERIAL = sim.Material(poisson_ratio=0.3, bending_stiffness=1.0)
CELLS = 32
GOLD_CELLS = 24


SINGULAR = "32 cells beside the singular corners of the clamps"


@known_answer(["clamped_stretch_neck"], unit="m", tolerance=3e-4, smoke=False, reason=SINGULAR)
@known_answer(["clamped_stretch_force"], unit="N", tolerance=0.01, smoke=False, reason=SINGULAR)
@cache
def clamped_stretch() -> dict[str, tuple[float, float]]:
    """Return the force on a clamp, or the width of the neck half-way, ours and of P2 by scikit-fem."""
    ours, gold = _ours(), _gold()
    return {f"clamped_stretch_{name}": (ours[name], gold[name]) for name in gold}


def _ours() -> dict[str, float]:
    points, faces = jittered_patch(CELLS)
    clamps = (points[:, 0] < 1e-9) | (points[:, 0] > 1 - 1e-9)
    cloth = sim.Cloth(in_space(points), faces, MATERIAL, pins=np.flatnonzero(clamps))
    potential = sim.Potential([energies.StretchStVK(cloth), energies.BendHinge(cloth)])
    stretched = cloth.rest_positions * [STRETCH, 1.0, 1.0]
    result = demand_converged(sim.minimise(potential, stretched, tolerance=1e-9), "the sheet")
    pull = potential.gradient(result.positions)[points[:, 0] > 1 - 1e-9, 0].sum()
    middle = (np.abs(points[:, 0] - 0.5) < 1e-9) & (np.abs(points[:, 1] - 0.5) > 0.5 - 1e-9)
    return {"force": float(pull), "neck": float(np.ptp(result.positions[middle, 1]))}


def _gold() -> dict[str, float]:
    import skfem

    # Graded towards the corners of the clamps, where the stress is singular.
    line = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, GOLD_CELLS + 1))
    mesh = skfem.MeshTri.init_tensor(line, line)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP2()), intorder=5)

    @skfem.LinearForm
    def residual(v, w):
        F = w["position"].grad
        return virtual_work(F, stress(strain(F), MATERIAL), v.grad)

    @skfem.BilinearForm
    def tangent(u, v, w):
        F = w["position"].grad
        change_of_stress = stress(change_of_strain(F, u.grad), MATERIAL)
        return virtual_work(u.grad, stress(strain(F), MATERIAL), v.grad) + virtual_work(
            F, change_of_stress, v.grad
        )

    x = basis.project(lambda X: np.stack([STRETCH * X[0], X[1]]))
    left = basis.get_dofs(lambda X: np.isclose(X[0], 0)).all()
    right = basis.get_dofs(lambda X: np.isclose(X[0], 1)).all()
    held = np.concatenate([left, right])
    for _ in range(20):
        field = basis.interpolate(x)
        r = residual.assemble(basis, position=field)
        step = skfem.solve(*skfem.condense(tangent.assemble(basis, position=field), -r, D=held))
        x = x + step
        if np.abs(step).max() < 1e-12:
            break
    else:
        raise RuntimeError("the reference did not converge")
    r = residual.assemble(basis, position=basis.interpolate(x))
    pulled = basis.get_dofs(lambda X: np.isclose(X[0], 1)).all(["u^1"])
    middle = np.flatnonzero(np.abs(mesh.p[0] - 0.5) < 1e-9)
    heights = x[basis.nodal_dofs[1, middle]]
    return {"force": float(r[pulled].sum()), "neck": float(np.ptp(heights))}
