"""A flat rest shape by the faces' corners: one definition for every term, and what is no pattern."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import Cloth
from reference_sim.cloth import MeshError
from reference_sim.energies import BendHinge, Gravity, StretchSpring, StretchStVK
from reference_sim.files.mesh_files import Surface, join_seams, rest_chart
from tests.reference_sim.meshes import grid
from tests.snug.garments.garment_files import doubled_along, own_chart

SHEET = grid(6, 5, width=0.4, depth=0.3)
MOVED = SHEET[0] + np.random.default_rng(3).normal(0, 0.01, SHEET[0].shape)


@pytest.mark.parametrize("term", [StretchStVK, StretchSpring, BendHinge, Gravity])
def test_an_isometric_chart_whole_or_with_a_seam_on_every_edge_gives_the_same_energies(term):
    value, gradient = term(Cloth(*SHEET)).value_and_gradient(MOVED)
    shrunk = 0.5 * SHEET[0] + [1.0, 0.0, 0.0]  # where the cloth starts, and of no rest state
    for chart in (SHEET[0][:, [2, 0]], own_chart(*SHEET)):
        other, others = term(Cloth(shrunk, SHEET[1], rest_uv=chart)).value_and_gradient(MOVED)
        assert other == pytest.approx(value, rel=1e-12)
        np.testing.assert_allclose(others, gradient, atol=1e-12 * np.abs(gradient).max())


def test_a_seam_between_pieces_of_two_sizes_has_the_mean_length():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    chart = own_chart(square, faces)
    chart[1] *= 3.0
    cloth = Cloth(square, faces, rest_uv=chart)
    assert cloth.hinge_lengths == pytest.approx([2 * np.sqrt(2)])
    assert cloth.hinge_areas == pytest.approx([0.5 + 4.5])
    assert cloth.edge_lengths == pytest.approx([1, 1, 2 * np.sqrt(2), 3, 3])


def test_vertices_doubled_for_their_chart_are_joined_by_place_and_keep_it():
    positions, faces = SHEET
    positions = positions - [0.2, 0.0, 0.0]
    cut = np.flatnonzero(np.abs(positions[:, 0]) < 1e-9)
    twice, split = doubled_along(positions, faces, cut)
    chart = twice[split][:, :, [0, 2]] + np.where(split.max(1) >= len(positions), 9.0, 0.0)[:, None, None]
    joined, kept = join_seams(Surface(twice, split, uv=chart))
    np.testing.assert_array_equal(joined.positions, positions)
    np.testing.assert_array_equal(joined.faces, faces)
    np.testing.assert_array_equal(kept, np.arange(len(positions)))
    cloth = Cloth(joined.positions, joined.faces, rest_uv=rest_chart(joined, 1.0))
    np.testing.assert_allclose(cloth.edge_lengths, Cloth(positions, faces).edge_lengths, rtol=1e-12)


def test_a_chart_in_another_unit_is_refused_with_the_scale_that_mends_it():
    surface = Surface(*SHEET, uv=own_chart(*SHEET) / 0.25)
    with pytest.raises(MeshError, match=r"uv_scale=0\.25 makes them equal"):
        rest_chart(surface, 1.0)
    np.testing.assert_allclose(rest_chart(surface, 0.25), own_chart(*SHEET))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda uv: None, "has no UV"),
        (
            lambda uv: np.where(np.arange(len(uv))[:, None, None] == 7, np.nan, uv),
            "triangle 7 has a corner",
        ),
        (lambda uv: np.where(np.arange(len(uv))[:, None, None] == 4, 0.0, uv), "triangle 4 has no area"),
        (
            lambda uv: uv * [4.0, 0.25],
            "that is a texture and no pattern",
        ),  # each triangle along its own axes
    ],
)
def test_a_chart_that_is_no_pattern_is_refused(spoil, message):
    with pytest.raises(MeshError, match=message):
        rest_chart(Surface(*SHEET, uv=spoil(own_chart(*SHEET))), 1.0)
