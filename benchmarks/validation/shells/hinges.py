"""Hinge bending of folded strips: every inner column turns by the same angle, so the energy is a product."""

from __future__ import annotations

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, random_rotation, right_grid
from benchmarks.validation.case import known_answer
from reference_sim import energies

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
    cloth, x = _folded(fold)
    edges = (COLUMNS - 1) * ROWS
    scale = _scale() if scaling == "length_area" else 1.0
    exact = edges * scale * cloth.material.bending_stiffness / 2 * fold**2
    return energies.BendHinge(cloth, scaling=scaling).value_and_gradient(x)[0] / exact


@known_answer(expected=1.0, tolerance=1e-12, reason="round-off")
def hinges_past_half_a_turn() -> float:
    """Return the energy with rest angles of 3 rad and a fold of -3 rad: the short way is 2 pi - 6."""
    cloth, x = _folded(-3.0)
    upright = np.ptp(cloth.rest_positions[cloth.hinges[:, :2], 0], axis=1) < 1e-9
    # The sign of a hinge's angle follows from its numbering; a fold of -3 is -3 or 3 there.
    angles = np.where(upright, -_signs(cloth) * 3.0, 0.0)
    bend = energies.BendHinge(cloth, rest_angles=angles)
    exact = upright.sum() * _scale() * cloth.material.bending_stiffness / 2 * (2 * np.pi - 6) ** 2
    return bend.value_and_gradient(x)[0] / exact


@known_answer(
    unit="N", expected=0.0, tolerance=1e-14, reason="round-off of angles times k over a cell of 0.1 m"
)
def hinges_rest_shape_force() -> float:
    """Return the largest force in a strip whose rest angles are those of its folded shape, turned."""
    cloth, x = _folded(0.8)
    curved = sim.Cloth(x, cloth.faces, cloth.material)
    bend = energies.BendHinge(curved, rest_angles="rest")
    return float(np.abs(sim.Potential([bend]).gradient(x @ random_rotation(5).T)).max())


def _scale() -> float:
    """Return l^2 / (4 (A1 + A2)) of an upright edge."""
    length = DEPTH / ROWS
    return length**2 / (4 * CELL * length)


def _folded(fold: float) -> tuple[sim.Cloth, np.ndarray]:
    points, faces = right_grid(ROWS, COLUMNS, DEPTH, COLUMNS * CELL)
    heading = fold * np.arange(COLUMNS)
    steps = CELL * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    profile = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    column = np.rint(points[:, 0] / CELL).astype(int)
    x = np.stack([profile[column, 0], points[:, 1], profile[column, 1]], axis=1)
    return sim.Cloth(in_space(points), faces, sim.Material()), x @ random_rotation(4).T


def _signs(cloth: sim.Cloth) -> np.ndarray:
    """Return the sign of each hinge's angle where the strip is folded by a small negative angle, (H,)."""
    from reference_sim.energies.bend_hinge import dihedral_angles

    return np.sign(dihedral_angles(_folded(-0.1)[1], cloth.hinges))
