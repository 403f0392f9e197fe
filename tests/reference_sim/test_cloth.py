"""The rest state on meshes small enough to check by hand, and every mesh that is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from reference_sim import Cloth, Material, MeshError

KITE = np.array([(0, 0, 0), (2, 0, 0), (1, 1, 0), (1, -3, 0)], dtype=float)
KITE_FACES = np.array([(0, 1, 2), (1, 0, 3)])


def test_two_triangles_by_hand():
    cloth = Cloth(KITE, KITE_FACES, Material(thickness=0.5, density=4.0))
    assert cloth.areas == pytest.approx([1.0, 3.0], rel=1e-15)
    assert cloth.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3]]
    assert cloth.edge_lengths == pytest.approx([2, 2**0.5, 10**0.5, 2**0.5, 10**0.5], rel=1e-15)
    # The face that walks 0 -> 1 comes first.
    assert cloth.hinges.tolist() == [[0, 1, 2, 3]]
    assert cloth.hinge_lengths.tolist() == [2.0]
    assert cloth.hinge_areas == pytest.approx([4.0], rel=1e-15)
    assert cloth.vertex_areas == pytest.approx([4 / 3, 4 / 3, 1 / 3, 1.0], rel=1e-15)
    assert cloth.masses == pytest.approx([8 / 3, 8 / 3, 2 / 3, 2.0], rel=1e-15)


def moved(index: int, to: tuple[float, float, float]) -> np.ndarray:
    x = KITE.copy()
    x[index] = to
    return x


FAN = np.array([*KITE, (1, 0, 2)], dtype=float)
THREE = np.array([*KITE_FACES, (0, 1, 4)])
REFUSED = [
    ("shape of positions", KITE[:, :2], KITE_FACES, {}, "rest_positions has shape (4, 2)"),
    ("faces that are no integers", KITE, KITE_FACES.astype(float), {}, "float64"),
    ("nan", moved(2, (0, np.nan, 0)), KITE_FACES, {}, "vertex 2 is not finite"),
    ("index too high", KITE, np.array([(0, 1, 2), (1, 0, 4)]), {}, "face 1 = [1, 0, 4]"),
    ("a vertex twice", KITE, np.array([(0, 1, 2), (1, 0, 3), (2, 2, 1)]), {}, "face 2 = [2, 2, 1]"),
    ("unused vertex", KITE, KITE_FACES[:1], {}, "vertex 3 belongs to no face"),
    ("coincident vertices", moved(3, (1, 1, 0)), KITE_FACES, {}, "vertices 2 and 3 coincide"),
    ("zero area", moved(3, (1, 0, 0)), KITE_FACES, {}, "face 1 has no rest area"),
    ("three faces at an edge", FAN, THREE, {}, "edge (0, 1) has 3 faces [0, 1, 2]"),
    (
        "winding",
        KITE,
        np.array([(0, 1, 2), (0, 1, 3)]),
        {},
        "faces 0 and 1 walk edge (0, 1) the same way",
    ),
    ("pin too high", KITE, KITE_FACES, {"pins": [1, 4]}, "pins 1 to 4: give indices from 0 to 3"),
    ("shape of uv", KITE, KITE_FACES, {"rest_uv": KITE}, "rest_uv has shape (4, 3)"),
]


@pytest.mark.parametrize("gap", [1e-9, 1e-6, 1e-5, 1e-3])
def test_a_seam_left_open_is_refused_and_a_slit_or_a_narrow_strip_is_not(gap):
    x = 0.1 * np.array([(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)])
    pair, faces = np.concatenate([x, x]), np.array([(0, 2, 1), (0, 3, 2), (4, 6, 5), (4, 7, 6)])
    right = (np.arange(8) >= 4)[:, None] * [1.0, 0.0, 0.0]
    with pytest.raises(MeshError, match=f"4 vertices of a seam lie up to {1e3 * gap:.2g} mm apart"):
        Cloth(pair + (0.1 + gap) * right, faces)
    Cloth(pair + 0.12 * right, faces)
    Cloth((x * [gap, 1.0, 1.0]), faces[:2])


@pytest.mark.parametrize(("what", "x", "faces", "more", "message"), REFUSED)
def test_a_mesh_that_cannot_be_simulated_is_refused_by_name(what, x, faces, more, message):
    with pytest.raises(ValueError, match=re.escape(message)) as refused:  # as callers catch it
        Cloth(x, faces, **more)
    assert refused.type is MeshError
