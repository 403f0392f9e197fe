"""Lateral buckling: a strip on edge, clamped at one end, gives way sideways under a load or its own weight.

P = 4.0126 (EI GJ)^0.5 / L^2 at the other end (Michell 1899, Prandtl 1899), or 12.85 (EI GJ)^0.5 / L^2 spread
evenly over the length (Timoshenko and Gere, Theory of Elastic Stability), the limit of narrow strips of the
test of Romero et al. 2021. On equilateral triangles the hinges are an
isotropic plate (see plates.py) with D = k/4 and nu = -1/3, so for a narrow strip of width b
EI = D (1 - nu^2) b and GJ = 2 D (1 - nu) b.
"""

from __future__ import annotations

import numpy as np

import reference_sim as sim
from benchmarks.meshes import ROW, in_space, rectangle
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.dead_load import DeadLoad
from benchmarks.validation.shells.plates import NU
from reference_sim import energies

K = 1e-5  # [J] hinge stiffness: so small that the strip hardly sags in its own plane before it buckles
MATERIAL = sim.Material(poisson_ratio=0.3, bending_stiffness=K)
CRITICAL = {"end": 4.0126, "weight": 12.85}  # total load, over (EI GJ)^0.5 / L^2
ROWS = (4, 8)


@known_answer(
    {"lateral_buckling": {}}, expected=1.0, tolerance=0.03, smoke=False,
    reason="the clamp holds back warping over a width, 4 % of the length",
)  # fmt: skip
def critical_load(where: str = "end", slender: float = 0.04) -> float:
    """Return the load at which a strip on edge buckles sideways, over the closed form.

    Args:
        where: the load acts, "end" or "weight".
        slender: width over length.

    The free edges lack half a hinge, an error of first order in the cell: two meshes are extrapolated.
    """
    coarse, fine = (_ratio(rows, where, slender) for rows in ROWS)
    return 2 * fine - coarse


def _ratio(rows: int, where: str, slender: float) -> float:
    columns = round(rows * ROW / slender)
    h = 1 / (columns - 0.5)  # the clamp lies half-way between the two pinned columns
    width = rows * h * ROW
    points, faces = rectangle("equilateral", columns, rows, columns * h, width)
    points -= [h / 2, width / 2]
    cloth = sim.Cloth(in_space(points), faces, MATERIAL, pins=np.flatnonzero(points[:, 0] < 0.51 * h))
    D, nu = K / 4, NU
    exact = CRITICAL[where] * width * D * np.sqrt((1 - nu**2) * 2 * (1 - nu))
    forces = np.zeros((len(points), 3))
    if where == "weight":
        forces[:, 1] = -exact * cloth.vertex_areas / width
    else:
        tip = np.flatnonzero(points[:, 0] > 1 - 1e-9)
        share = 1.0 - (2 * np.abs(points[tip, 1]) / width) ** 2  # shear of a beam: least at the free edges
        forces[tip, 1] = -exact * share / share.sum()
    return buckling_factor(cloth, forces)


def buckling_factor(cloth: sim.Cloth, forces: np.ndarray) -> float:
    """Return the factor on dead loads (V, 3) [N] at which a flat sheet in the plane z = 0 gives way sideways.

    Raises RuntimeError where the sheet in its plane does not converge.
    """
    import scipy.sparse as sp
    import scipy.sparse.linalg as spla

    strain, stiff = energies.StretchStVK(cloth), energies.BendHinge(cloth)
    stiff.stiffness = 1e5 * stiff.stiffness  # keeps the loaded strip in its plane, where hinges do no work
    in_plane = sim.Potential([strain, stiff, DeadLoad(cloth, forces)])
    flat = demand_converged(
        sim.minimise(in_plane, cloth.rest_positions, tolerance=1e-9), "the strip in its plane"
    )
    free = np.flatnonzero(cloth.free)

    def out_of_plane(potential: sim.Potential, x: np.ndarray) -> sp.csc_matrix:
        return sp.csc_matrix(potential.hessian(x)[2::3][:, 2::3][free][:, free])

    bending = out_of_plane(sim.Potential([energies.BendHinge(cloth)]), cloth.rest_positions)
    stress = out_of_plane(sim.Potential([strain]), flat.positions)
    # (bending + factor stress) w = 0: 1/factor is the largest eigenvalue of -stress against bending.
    start = np.ones(len(free))
    values = spla.eigsh(-stress, k=1, M=bending, which="LA", v0=start, return_eigenvectors=False)
    return 1 / float(values[0])
