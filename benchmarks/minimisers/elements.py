"""Strain, fold angle and contact depth of one element with their gradients, for sweeps over a mesh.

Written for one element at a time, where the energies' own kernels run over all: a Gauss-Seidel sweep moves
vertices between one element and the next. Tests hold them to the energies' gradients and Hessians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from reference_sim import Potential
    from reference_sim.energies import BendHinge, ContactPenalty, Energy, Gravity, Inertia, StretchStVK


# By the names of the classes: a term that the potential does not have is not even imported.
KINDS = {
    "Inertia": "inertia", "Gravity": "gravity", "StretchStVK": "strain", "BendHinge": "bending",
    "ContactPenalty": "contact",
}  # fmt: skip
FAR = 100.0  # [m] from the guess: nowhere


@dataclass(frozen=True)
class Terms:
    """The terms of a potential by kind; None where it has no such term."""

    inertia: Inertia
    gravity: Gravity | None
    strain: StretchStVK | None
    bending: BendHinge | None
    contact: ContactPenalty | None


def terms_of(potential: Potential, sweeper: str) -> Terms:
    """The terms that the sweeps know. Raises ValueError naming the term that `sweeper` has no sweep for."""
    found: dict[str, Energy | None] = dict.fromkeys(KINDS.values())
    for energy in potential.energies:
        kind = KINDS.get(type(energy).__name__)
        if kind is None or found[kind] is not None:
            raise ValueError(f"{sweeper} has no sweep for the term {energy.name!r}: use newton or lbfgs")
        found[kind] = energy
    if found["inertia"] is None:
        raise ValueError(f"{sweeper} takes steps in time: the potential needs inertia")
    return Terms(**found)  # type: ignore[arg-type]


def membrane(term: StretchStVK | None) -> tuple:
    """faces, Dm^-1, areas, lambda, mu for a kernel; no faces without the term."""
    if term is None:
        return np.zeros((0, 3), np.int64), np.zeros((0, 2, 2)), np.zeros(0), 0.0, 0.0
    return _whole(term.stencils), term.Dm_inverse, term.areas, float(term.lam), float(term.mu)


def hinges(term: BendHinge | None) -> tuple:
    """hinges, stiffness, rest angles for a kernel; none without the term."""
    if term is None:
        return np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(0)
    return _whole(term.stencils), term.stiffness, term.rest_angles


def contacts(term: ContactPenalty | None) -> tuple:
    """stencils, weights, stiffness, margin, points, normals for a kernel, as the step has frozen them."""
    if term is None:
        none = np.zeros((0, 3))
        return np.zeros((0, 3), np.int64), none, np.zeros(0), 0.0, none, none
    planes = np.ascontiguousarray(term.points), np.ascontiguousarray(term.normals)
    return _whole(term.stencils), term.weights, term.stiffness, term.margin, *planes


def weights(terms: Terms) -> np.ndarray:
    """Weight of each vertex [N], (V,); zero without gravity."""
    return np.zeros_like(terms.inertia.masses) if terms.gravity is None else terms.gravity.weights


def _whole(stencils: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(stencils, dtype=np.int64)


def runaway(x: np.ndarray, x0: np.ndarray) -> bool:
    """Whether a vertex is nowhere, or FAR from where it began."""
    return not (np.isfinite(x).all() and np.abs(x - x0).max(initial=0.0) < FAR)


@njit(cache=True, inline="always")
def strain(x, face, D, fa, fb):
    """G00, G11, G01 of the Green strain; the columns of F are written into fa and fb."""
    p, q, r = face[0], face[1], face[2]
    for i in range(3):
        first, second = x[q, i] - x[p, i], x[r, i] - x[p, i]
        fa[i] = first * D[0, 0] + second * D[1, 0]
        fb[i] = first * D[0, 1] + second * D[1, 1]
    aa = fa[0] * fa[0] + fa[1] * fa[1] + fa[2] * fa[2]
    bb = fb[0] * fb[0] + fb[1] * fb[1] + fb[2] * fb[2]
    ab = fa[0] * fb[0] + fa[1] * fb[1] + fa[2] * fb[2]
    return 0.5 * (aa - 1.0), 0.5 * (bb - 1.0), 0.5 * ab


@njit(cache=True, inline="always")
def hat(D, corner):
    """Gradient of the hat function of a corner in rest coordinates [1/m]."""
    if corner == 0:
        return -D[0, 0] - D[1, 0], -D[0, 1] - D[1, 1]
    return D[corner - 1, 0], D[corner - 1, 1]


@njit(cache=True, error_model="numpy")
def fold(x, hinge, rest, gradient):
    """theta - rest, wrapped into half a turn, of one hinge; its gradient (4, 3) [1/m] is written.

    A face of a hinge turns by one radian where its tip moves by its height over the edge, along the normal.
    """
    p, q = hinge[0], hinge[1]
    e0, e1, e2 = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
    length = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    normals = np.empty((2, 3))
    for side in range(2):
        t = hinge[2 + side]
        r0, r1, r2 = x[t, 0] - x[p, 0], x[t, 1] - x[p, 1], x[t, 2] - x[p, 2]
        sign = 1.0 if side == 0 else -1.0
        n0, n1, n2 = sign * (e1 * r2 - e2 * r1), sign * (e2 * r0 - e0 * r2), sign * (e0 * r1 - e1 * r0)
        normals[side, 0], normals[side, 1], normals[side, 2] = n0, n1, n2
        along = (e0 * r0 + e1 * r1 + e2 * r2) / length
        scale = 1.0 / (n0 * n0 + n1 * n1 + n2 * n2)
        for i in range(3):
            m = normals[side, i] * scale
            if side == 0:
                gradient[0, i], gradient[1, i] = 0.0, 0.0
            gradient[0, i] += (length - along) * m
            gradient[1, i] += along * m
            gradient[2 + side, i] = -length * m
    a, b = normals[0], normals[1]
    c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    sine = (e0 * c0 + e1 * c1 + e2 * c2) / length
    angle = np.arctan2(sine, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) - rest
    return angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)


@njit(cache=True, inline="always")
def depth(x, stencil, weight, margin, point, normal):
    """max(margin - n . (x_s - c), 0) of one contact sample [m]."""
    distance = 0.0
    for i in range(3):
        sample = weight[0] * x[stencil[0], i] + weight[1] * x[stencil[1], i] + weight[2] * x[stencil[2], i]
        distance += normal[i] * (sample - point[i])
    return max(margin - distance, 0.0)
