"""The rest state on meshes small enough to check by hand, and every mesh that is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from reference_sim import Cloth, Material, MeshError
from tests.reference_sim.meshes import grid, patch, random_rotation

KITE = np.array([(0, 0, 0), (2, 0, 0), (1, 1, 0), (1, -3, 0)], dtype=float)
KITE_FACES = np.array([(0, 1, 2), (1, 0, 3)])


def test_two_triangles_by_hand():
    cloth = Cloth(KITE, KITE_FACES, Material(thickness=0.5, density=4.0))
    assert cloth.vertex_count == 4
    assert cloth.areas == pytest.approx([1.0, 3.0], rel=1e-15)
    assert cloth.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3]]
    assert cloth.edge_lengths == pytest.approx([2, 2**0.5, 10**0.5, 2**0.5, 10**0.5], rel=1e-15)
    # The face that walks 0 -> 1 comes first.
    assert cloth.hinges.tolist() == [[0, 1, 2, 3]]
    assert cloth.hinge_lengths.tolist() == [2.0]
    assert cloth.hinge_areas == pytest.approx([4.0], rel=1e-15)
    assert cloth.vertex_areas == pytest.approx([4 / 3, 4 / 3, 1 / 3, 1.0], rel=1e-15)
    assert cloth.masses == pytest.approx([8 / 3, 8 / 3, 2 / 3, 2.0], rel=1e-15)


def test_an_unstructured_patch_turned_in_space():
    flat, faces = patch(1)
    cloth = Cloth(flat @ random_rotation(2).T + 3.0, faces)
    corner = flat[faces]
    exact = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] / 2
    assert cloth.areas == pytest.approx(exact, rel=1e-12)  # round-off of a turn at 5 m from the origin
    assert cloth.masses.sum() == pytest.approx(cloth.material.areal_density * 1.0, rel=1e-12)
    # Euler: V - E + F = 1 for a disc; each inner edge is one hinge.
    assert cloth.vertex_count - len(cloth.edges) + len(faces) == 1
    assert len(cloth.hinges) == 3 * len(faces) - len(cloth.edges)


def test_the_deformation_gradient_of_rest_is_an_isometry_and_of_a_stretch_is_the_stretch():
    flat, faces = patch(3)
    cloth = Cloth(flat @ random_rotation(4).T, faces)

    def right_cauchy_green(x: np.ndarray) -> np.ndarray:
        sides = np.stack([x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]]], axis=-1)
        F = sides @ cloth.Dm_inverse
        return F.transpose(0, 2, 1) @ F

    # Round-off times the worst 1/height of a face, about 30.
    assert np.abs(right_cauchy_green(cloth.rest_positions) - np.eye(2)).max() < 1e-12
    stretched = right_cauchy_green(flat * [1.5, 0.8, 1.0])
    assert np.linalg.eigvalsh(stretched) == pytest.approx(np.tile([0.64, 2.25], (len(faces), 1)), rel=1e-12)


def test_hinges_name_their_own_two_faces():
    x, faces = patch(5)
    cloth = Cloth(x, faces)
    walks = {(f[k], f[(k + 1) % 3]): f[(k + 2) % 3] for f in faces.tolist() for k in range(3)}
    for a, b, first, second in cloth.hinges.tolist():
        assert walks[a, b] == first and walks[b, a] == second
        i, j = (np.flatnonzero((faces == a).any(1) & (faces == b).any(1))).tolist()
        row = np.flatnonzero((cloth.hinges[:, :2] == (a, b)).all(1))
        assert cloth.hinge_areas[row] == pytest.approx(cloth.areas[i] + cloth.areas[j], rel=1e-15)


def test_rest_uv_replaces_the_rest_state_of_everything_but_the_start():
    x, faces = grid(3, 2)
    cloth = Cloth(x, faces, rest_uv=2 * x[:, [2, 0]])
    plain = Cloth(x, faces)
    assert cloth.areas == pytest.approx(4 * plain.areas, rel=1e-15)
    assert cloth.masses == pytest.approx(4 * plain.masses, rel=1e-15)
    assert cloth.edge_lengths == pytest.approx(2 * plain.edge_lengths, rel=1e-15)
    assert cloth.hinge_lengths == pytest.approx(2 * plain.hinge_lengths, rel=1e-15)
    assert cloth.hinge_areas == pytest.approx(4 * plain.hinge_areas, rel=1e-15)
    assert (cloth.rest_positions == x).all()


def test_a_cloth_keeps_its_rest_state_when_the_callers_arrays_change():
    x, faces = grid(2, 2)
    uv = x[:, [0, 2]].copy()
    cloth, plain = Cloth(x, faces, rest_uv=uv), Cloth(x.copy(), faces.copy())
    x += 1.0
    uv *= 2.0
    faces[:] = 0
    assert (cloth.rest_positions == plain.rest_positions).all() and (cloth.faces == plain.faces).all()
    assert cloth.areas == pytest.approx(plain.areas) and cloth.edge_lengths == pytest.approx(
        plain.edge_lengths
    )


def moved(index: int, to: tuple[float, float, float]) -> np.ndarray:
    x = KITE.copy()
    x[index] = to
    return x


FAN = np.array([*KITE, (1, 0, 2)], dtype=float)
THREE = np.array([*KITE_FACES, (0, 1, 4)])
FLAT_UV = np.array([(0, 0), (2, 0), (1, 1), (1, 0)], dtype=float)
NAN_UV = FLAT_UV * [[np.nan], [1], [1], [1]]
REFUSED = [
    ("shape of positions", KITE[:, :2], KITE_FACES, {}, "rest_positions has shape (4, 2)"),
    ("shape of faces", KITE, KITE_FACES[:, :2], {}, "faces has shape (2, 2)"),
    ("faces that are no integers", KITE, KITE_FACES.astype(float), {}, "float64"),
    ("no faces", KITE, np.zeros((0, 3), int), {}, "no faces"),
    ("nan", moved(2, (0, np.nan, 0)), KITE_FACES, {}, "vertex 2 is not finite"),
    ("infinity", moved(3, (np.inf, 0, 0)), KITE_FACES, {}, "vertex 3 is not finite"),
    ("index too high", KITE, np.array([(0, 1, 2), (1, 0, 4)]), {}, "face 1 = [1, 0, 4]"),
    ("negative index", KITE, np.array([(0, 1, 2), (1, 0, -1)]), {}, "face 1 = [1, 0, -1]"),
    ("a vertex twice", KITE, np.array([(0, 1, 2), (1, 0, 3), (2, 2, 1)]), {}, "face 2 = [2, 2, 1]"),
    ("unused vertex", KITE, KITE_FACES[:1], {}, "vertex 3 belongs to no face"),
    ("coincident vertices", moved(3, (1, 1, 0)), KITE_FACES, {}, "vertices 2 and 3 coincide"),
    ("zero area", moved(3, (1, 0, 0)), KITE_FACES, {}, "face 1 has no rest area"),
    ("three faces at an edge", FAN, THREE, {}, "edge (0, 1) has 3 faces [0, 1, 2]"),
    ("winding", KITE, np.array([(0, 1, 2), (0, 1, 3)]), {}, "faces 0 and 1 walk edge (0, 1) the same way"),
    ("pin too high", KITE, KITE_FACES, {"pins": [1, 4]}, "pin 4 is no vertex"),
    ("negative pin", KITE, KITE_FACES, {"pins": [-1]}, "pin -1 is no vertex"),
    ("pins as a mask", KITE, KITE_FACES, {"pins": [True, False, False, True]}, "pins are bool"),
    ("pins as numbers", KITE, KITE_FACES, {"pins": [0.5]}, "pins are float64"),
    ("shape of uv", KITE, KITE_FACES, {"rest_uv": KITE}, "rest_uv has shape (4, 3)"),
    ("uv not finite", KITE, KITE_FACES, {"rest_uv": NAN_UV}, "rest_uv"),
    ("uv of zero area", KITE, KITE_FACES, {"rest_uv": FLAT_UV}, "face 1"),
]


@pytest.mark.parametrize(
    ("x", "faces", "more", "message"), [case[1:] for case in REFUSED], ids=[case[0] for case in REFUSED]
)
def test_a_mesh_that_cannot_be_simulated_is_refused_by_name(x, faces, more, message):
    with pytest.raises(ValueError, match=re.escape(message)) as refused:  # as callers catch it
        Cloth(x, faces, **more)
    assert refused.type is MeshError
