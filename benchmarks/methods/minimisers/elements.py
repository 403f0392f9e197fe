"""Terms of a potential as arrays for sweeps over its elements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from reference_sim.energies import BendHinge, ContactPenalty, StretchStVK
    from reference_sim.energies.term_kinds import Terms


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
