"""Hinges as bending: folded strips, the plate that they stand for, Gaussian curvature.

Kirchhoff's plate has the energy D/2 [tr(S)^2 - 2 (1 - nu) det(S)] per area, S the curvature tensor.
Hinges are no such plate: C11, the stiffness against bending about one axis, depends on the shape of the
triangles, and on equilateral ones nu is -1/3 whatever the material. With theta = l (3^0.5/2) (w_nn -
w_tt/3) at the edges of direction t, summed over the three directions of an equilateral mesh of spacing l:
C11 = 3^0.5/2 k, C12 = -C11/3, C66 = k/3^0.5 where hinges are not scaled, and with l^2/(4 (A1 + A2)),
there 1/(2 3^0.5), C11 = k/4. No other family is isotropic (table in docs/notebook/simulator.md).

Squares with both diagonals, w = x^2/2 at the corners and d above that at the centres: per cell the hinges
of the sides turn by 4 d +- 1/2 and those of the four half diagonals by 8^0.5 (1/8 - d), so the energy
over k/2 is 1 - 8 d + 64 d^2, at least 3/4; scaled by l^2/(4 (A1 + A2)) it is 3/8 - 2 d + 24 d^2, at least
1/3. Alternating diagonals are the same tiling turned by 45 degrees: 3/4 again, and 5/24.

Plates of one D that differ in nu differ by a multiple of the total curvature, the integral of K = det(S).
On a mesh that is the sum of the angle defects of inner vertices (Descartes), and therefore a function of
the border alone (Gauss and Bonnet):

    sum of defects = 2 pi (inner vertices) - pi (faces) + sum of the face angles at border vertices
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

import reference_sim as sim
from benchmarks.meshes import ROW, random_rotation, rectangle, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import flat_cloth
from reference_sim import energies
from reference_sim.geometry.topology import boundary_loops, corner_angles

if TYPE_CHECKING:
    from torch import Tensor

COLUMNS, ROWS, CELL, DEPTH = 6, 4, 0.1, 0.7


@known_answer(
    {
        "hinges_folded_unscaled": {"scaling": "none", "fold": 0.3},
        "hinges_folded_scaled": {"scaling": "length_area", "fold": -1.2},
    },
    expected=1.0, tolerance=1e-12, reason="round-off",
)  # fmt: skip
def folded(scaling: str, fold: float) -> float:
    """Return the energy of a strip folded by `fold` [rad] at each column, over its closed form.

    Each of (COLUMNS - 1) ROWS upright edges holds k/2 fold^2, times l^2/(4 (A1 + A2)) where scaled.
    """
    cloth, x = _fold(fold)
    edges = (COLUMNS - 1) * ROWS
    scale = _scale() if scaling == "length_area" else 1.0
    exact = edges * scale * cloth.material.bending_stiffness / 2 * fold**2
    return energies.BendHinge(cloth, scaling=scaling).value_and_gradient(x)[0] / exact


@known_answer(expected=1.0, tolerance=1e-12, reason="round-off")
def hinges_past_half_a_turn() -> float:
    """Return the energy with rest angles of 3 rad and a fold of -3 rad: the short way is 2 pi - 6."""
    from reference_sim.energies.bend_hinge import dihedral_angles

    cloth, x = _fold(-3.0)
    upright = np.ptp(cloth.rest_positions[cloth.hinges[:, :2], 0], axis=1) < 1e-9
    # The sign of a hinge's angle follows from its numbering; a fold of -3 is -3 or 3 there.
    signs = np.sign(dihedral_angles(_fold(-0.1)[1], cloth.hinges))
    angles = np.where(upright, -signs * 3.0, 0.0)
    bend = energies.BendHinge(cloth, rest_angles=angles)
    exact = upright.sum() * _scale() * cloth.material.bending_stiffness / 2 * (2 * np.pi - 6) ** 2
    return bend.value_and_gradient(x)[0] / exact


@known_answer(
    unit="N", expected=0.0, tolerance=1e-14, reason="round-off of angles times k over a cell of 0.1 m"
)
def hinges_rest_shape_force() -> float:
    """Return the largest force in a strip whose rest angles are those of its folded shape, turned."""
    cloth, x = _fold(0.8)
    curved = sim.Cloth(x, cloth.faces, cloth.material)
    bend = energies.BendHinge(curved, rest_angles="rest")
    return float(np.abs(sim.Potential([bend]).gradient(x @ random_rotation(5).T)).max())


def _scale() -> float:
    """Return l^2 / (4 (A1 + A2)) of an upright edge."""
    length = DEPTH / ROWS
    return length**2 / (4 * CELL * length)


def _fold(fold: float) -> tuple[sim.Cloth, np.ndarray]:
    points, faces = right_grid(ROWS, COLUMNS, DEPTH, COLUMNS * CELL)
    heading = fold * np.arange(COLUMNS)
    steps = CELL * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    profile = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    column = np.rint(points[:, 0] / CELL).astype(int)
    x = np.stack([profile[column, 0], points[:, 1], profile[column, 1]], axis=1)
    return flat_cloth(points, faces), x @ random_rotation(4).T


STIFFNESS = 1.0  # [J] k; every result is divided by it
NU = -1 / 3  # Poisson's ratio of hinges on equilateral triangles
CYLINDER = np.diag([1.0, 0.0])  # [1/m] curvature of a plate rolled up along x

SCALINGS = {"unscaled": "none", "scaled": "length_area"}
C11 = {  # over k: of the families on which it is rational or sqrt(3)/2
    "right": (1.0, 0.25), "cross": (3 / 4, 1 / 3), "union_jack": (3 / 4, 5 / 24),
    "equilateral": (3**0.5 / 2, 0.25),
}  # fmt: skip
Terms = Callable[[sim.Cloth], Sequence[energies.Energy]]


def _vary(families: Sequence[str]) -> dict[str, dict[str, str]]:
    """Return the variants of `plate_stiffness` on families of triangles, with hinges unscaled and scaled."""
    return {
        f"plate_stiffness_{family}_{title}": {"family": family, "scaling": scaling}
        for family in families
        for title, scaling in SCALINGS.items()
    }


@known_answer(_vary(["delaunay"]), smoke=False, reason="reported: a mean of one patch")
@known_answer(_vary([*C11]), smoke=False, tolerance=3e-4, reason="the corners leave (1/24)^2")
def plate_stiffness(family: str, scaling: str) -> tuple[float, float | None]:
    """Return the C11/k of hinges, twice the energy per area of a patch bent to a cylinder."""
    exact = C11.get(family, (None, None))[scaling != "none"]
    return 2 * patch_energy(family, CYLINDER, hinges(scaling)), exact


def hinges(scaling: str) -> Terms:
    """Return the terms of a plate of hinges alone."""
    return lambda cloth: [energies.BendHinge(cloth, scaling=scaling)]


def patch_energy(family: str, curvature: np.ndarray, terms: Terms) -> float:
    """Return the energy per area and k of a patch with a constant curvature at its border, inside at rest.

    Energy of an n x n patch = a n^2 + b n + c with the border in b and c; three sizes give a. The
    unstructured family has no cell that repeats, so there one larger patch is divided by its area.

    Args:
        family: of meshes.FAMILIES.
        curvature: (2,2) [1/m]; the two outer rings of vertices have w = x . curvature x / 2.
        terms: energies of the plate, where a cloth has k = 1 J.
    """
    height = ROW if family == "equilateral" else 1.0
    if family == "delaunay":
        energy, area = _bent(family, 48, 1.0, curvature, terms)
        return energy / area
    small, middle, large = (_bent(family, n, height, curvature, terms)[0] for n in (16, 24, 32))
    return (small - 2 * middle + large) / 128 / height


def _bent(
    family: str, cells: int, height: float, curvature: np.ndarray, terms: Terms
) -> tuple[float, float]:
    """Return the energy over k of a patch in equilibrium, and the area of its hinges."""
    import scipy.sparse.linalg as spla

    size = np.array([cells, cells * height])
    points, faces = rectangle(family, cells, cells, *size)
    cloth = flat_cloth(points, faces, sim.Material(bending_stiffness=STIFFNESS))
    # Out of the plane, (V,V).
    K = sim.Potential(list(terms(cloth))).hessian(cloth.rest_positions).tocsr()[2::3][:, 2::3]
    ring = ((points < 1.01) | (points > size - 1.01)).any(axis=1)
    w = 0.5 * np.einsum("vi,ij,vj->v", points, curvature, points)
    inside = np.flatnonzero(~ring)
    w[inside] = spla.spsolve(K[inside][:, inside], -(K[inside][:, ring] @ w[ring]))
    return 0.5 * float(w @ (K @ w)) / STIFFNESS, float(cloth.hinge_areas.sum() / 3)


class GaussianCurvature(energies.Energy):
    """Energy E = c (total curvature - that of the flat rest state), summed over the corners on the border.

    c = -NU D makes a plate of nu = 0 of hinges on equilateral triangles, D [J] their C11: the two
    energies differ by D (nu_0 - nu) det(S) per area, nu_0 = 0 and nu that of the hinges.

    Args:
        cloth: the rest state; it has to be flat.
        stiffness: c [J].
    """

    name = "gaussian_curvature"

    def __init__(self, cloth: sim.Cloth, stiffness: float) -> None:
        self.cloth = cloth
        # Tip, next, last.
        corners = np.stack([np.roll(cloth.faces, -k, axis=1) for k in range(3)], axis=1)
        on_border = np.isin(cloth.faces, np.concatenate(boundary_loops(cloth.faces)))
        self.stencils = corners[on_border]
        self.stiffness = stiffness
        self.rest_angles = corner_angles(cloth.rest_positions, cloth.faces)[on_border]

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each corner: u (..., N, 3, 3) [m] -> (..., N)."""
        import torch

        a, b = u[..., 1, :] - u[..., 0, :], u[..., 2, :] - u[..., 0, :]
        sine = torch.linalg.vector_norm(torch.linalg.cross(a, b), dim=-1)
        angles = torch.atan2(sine, (a * b).sum(-1))
        return self.stiffness * (angles - torch.as_tensor(self.rest_angles).to(u))
