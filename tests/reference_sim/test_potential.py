"""The sparse patterns of a sum of terms, with pins, against dense sums made here; what is no sum."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import Cloth, Potential
from reference_sim.energies import (
    BendHinge,
    ContactPenalty,
    Energy,
    Gravity,
    Inertia,
    Step,
    StretchSpring,
    StretchStVK,
)  # fmt: skip
from tests.reference_sim.meshes import patch


def all_terms(pins: tuple[int, ...] = ()) -> tuple[Cloth, list[Energy], np.ndarray]:
    """A cloth, every term of it, and a crumpled state."""
    x, faces = patch(31, cells=4)
    cloth = Cloth(0.3 * x, faces, pins=pins)
    contact = ContactPenalty(cloth)
    contact.points = contact.rest_samples - [0.0, 0.0, 0.001]  # 3 mm deep at rest
    contact.normals[:] = (0.0, 0.0, 1.0)
    terms = [
        StretchStVK(cloth),
        StretchSpring(cloth),
        BendHinge(cloth),
        Gravity(cloth),
        Inertia(cloth, 0.01),
    ]
    crumpled = cloth.rest_positions + np.random.default_rng(1).normal(0, 0.002, x.shape)
    return cloth, [*terms, contact], crumpled


def dense_sum(energies: list[Energy], x: np.ndarray) -> np.ndarray:
    """(3V, 3V): every element's block, from the definition by autodiff, added where its vertices are."""
    total = np.zeros((x.size, x.size))
    for energy in energies:
        for stencil, block in zip(energy.stencils, Energy.hessian_blocks(energy, x)):
            places = (3 * stencil[:, None] + np.arange(3)).ravel()
            np.add.at(total, np.ix_(places, places), block)  # a stencil may name a vertex twice
    return total


@pytest.mark.parametrize("pins", [(), (3, 4, 17, 24), tuple(range(1, 25))])
def test_the_pattern_of_free_vertices_is_a_part_of_the_whole(pins):
    cloth, energies, x = all_terms(pins)
    potential = Potential(energies)
    pattern, rows = potential.pattern(cloth.free), np.repeat(cloth.free, 3)
    expected = dense_sum(energies, x)[np.ix_(rows, rows)]
    data = pattern.assemble(x)
    assert len(pattern.indptr) == rows.sum() + 1
    # Sums of the same numbers in another order, after autodiff's own round-off.
    assert np.abs(pattern.symmetrise(data).toarray() - expected).max() < 1e-12 * np.abs(expected).max()
    if not pins:
        assert (potential.hessian(x) != pattern.symmetrise(data)).nnz == 0
    assert data[pattern.diagonal] == pytest.approx(expected.diagonal(), rel=1e-12)
    assert sorted(pattern.order.tolist()) == list(range(rows.sum()))
    # CSC as a factorisation reads it: rows of a column in order, the diagonal stored.
    for column in range(rows.sum()):
        stored = pattern.indices[pattern.indptr[column] : pattern.indptr[column + 1]]
        assert (np.diff(stored) > 0).all() and column in stored


def test_the_scalar_pattern_is_the_sum_of_scalar_stiffnesses():
    cloth, energies, x = all_terms((0, 7))
    pattern = Potential(energies).pattern(cloth.free, block=1)
    expected = np.zeros((len(x), len(x)))
    for energy in energies:
        if type(energy).scalar_stiffness is not Energy.scalar_stiffness:
            elements, blocks = energy.scalar_stiffness(x)
            assert np.abs(blocks).max() > 0
            for stencil, block in zip(energy.stencils[elements], blocks):
                np.add.at(expected, np.ix_(stencil, stencil), block)
    expected = expected[np.ix_(cloth.free, cloth.free)]
    assert np.linalg.eigvalsh(expected)[0] > 0  # what a preconditioner must be
    assembled = pattern.symmetrise(pattern.assemble(x)).toarray()
    assert np.abs(assembled - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("ask", ["terms", "value", "gradient", "hessian"])
def test_positions_of_another_mesh_are_refused(ask):
    """The compiled kernels look at no bounds."""
    _, terms, x = all_terms()
    with pytest.raises(ValueError, match=r"shape \(3, 3\): expected"):
        getattr(Potential(terms), ask)(x[:3])


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ((), "at least one energy"),
        ((Gravity, Gravity), "two energies are named 'gravity': give each a name of its own"),
        ((ContactPenalty,), "needs an obstacle"),
    ],
)
def test_terms_that_do_not_add_up_are_refused(terms, message):
    cloth, _, x = all_terms()
    with pytest.raises(ValueError, match=message):
        Potential([make(cloth) for make in terms]).prepare(Step(x, 0 * x, x, 0.1))
