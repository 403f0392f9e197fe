"""Meshes of other programs: what is read, in which order and unit, flat rest shapes, and what is refused.

A flat rest shape by the faces' corners is one definition for every term.
"""

from __future__ import annotations

import meshio
import numpy as np
import pytest

from reference_sim import Cloth
from reference_sim.cloth import MeshError
from reference_sim.energies import BendHinge, Gravity, StretchSpring, StretchStVK
from reference_sim.files.mesh_files import Surface, join_seams, read_mesh, read_sequence, rest_chart
from tests.reference_sim.meshes import grid, sphere
from tests.snug.garments.garment_files import doubled_along, own_chart


def write(path, positions, faces):
    path.parent.mkdir(exist_ok=True)
    meshio.write(path, meshio.Mesh(positions, [("triangle", np.asarray(faces, dtype=np.int32))]))
    return path


SEAM = (
    "v 0 0 0 1 1 0\nv 1 0 0 # with a colour\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 5 0\nvt 6 1\nvt 5 1\n"
)


def test_a_vertex_on_a_seam_has_a_texture_coordinate_in_each_face(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(SEAM + "f 1/1 2/2/ 3/3\nf 1/4/9 3/5 -1/-1\n")
    surface = read_mesh(path)
    assert surface.positions.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert surface.uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[5, 0], [6, 1], [5, 1]]]
    path.write_text(SEAM + "f 1/1 2/2 3/3 4/6\n")  # a quad is cut with its coordinates
    quad = read_mesh(path)
    assert quad.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert quad.uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [5, 1]]]
    path.write_text(SEAM + "f 1/1 2/2 3/3\nf 1 3 4\n")
    assert np.isnan(read_mesh(path).uv).all(axis=(1, 2)).tolist() == [False, True]
    path.write_text(SEAM + "f 1 2 3\nf 1//2 3//2 4//2\n")
    assert read_mesh(path).uv is None


def test_texture_coordinates_of_vertices_are_those_of_their_corners(tmp_path):
    positions, faces = grid(2, 1)
    uv, path = 3.0 * positions[:, [0, 2]], tmp_path / "a.ply"
    data = {"s": uv[:, 0], "t": uv[:, 1]}
    meshio.write(path, meshio.Mesh(positions, [("triangle", faces)], point_data=data))
    surface = read_mesh(path)
    np.testing.assert_array_equal(surface.faces, faces)
    np.testing.assert_allclose(surface.uv, uv[faces], atol=1e-6)


SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
PLY = (
    "ply\nformat {} 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_index\nproperty list uchar float texcoord\nend_header\n"
)
WEDGES = "3 0 1 2 6 0 0 1 0 1 1 3 0 2 3 0\n"  # the second triangle has no texture coordinates
BINARY = np.array(SQUARE.split(), "<f4").tobytes() + b"".join(
    b"\3" + np.array(face, "<i4").tobytes() + bytes([len(uv)]) + np.array(uv, "<f4").tobytes()
    for face, uv in (((0, 1, 2), (0, 0, 1, 0, 1, 1)), ((0, 2, 3), ()))
)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", PLY.format("ascii", 2) + SQUARE + WEDGES),
        ("a.ply", PLY.format("binary_little_endian", 2).encode() + BINARY),
        ("a.obj", "\ufeffv " + "\nv ".join(SQUARE.split("\n")[:4]) + "\nf 1 2 3 4\n"),
    ],
)
def test_each_variant_of_a_format_is_the_same_square(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    surface = read_mesh(path)
    assert surface.positions.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    if name == "a.ply":
        assert surface.uv[0].tolist() == [[0, 0], [1, 0], [1, 1]] and np.isnan(surface.uv[1]).all()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", None, "no such file"),
        ("a.fbx", "x", "unknown kind of mesh: convert it to one of .obj"),
        ("a.ply", "rubbish\n", "its header does not end"),
        ("a.ply", PLY.format("ascii", 10**18) + SQUARE + WEDGES, "ends before what its header states"),
        ("a.ply", PLY.format("ascii", 1) + SQUARE + WEDGES, "more numbers than its header states"),
        ("a.ply", PLY.format("ascii", 1) + SQUARE + "4000000000 0 1 2", "ends before what its header"),
        (
            "a.ply",
            PLY.format("ascii", 1) + SQUARE + "3 0 1.5 2 0",
            "a number of vertex_index is not whole",
        ),
        ("a.obj", "# a mesh\nv 0 0 zero\n", "line 2 is not understood: 'v 0 0 zero'"),
        ("a.obj", "v 0 0 0\nv 1 0 0\n", "no triangles in it"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1e300 0\nf 1 2 3\n", "vertex 2 is not finite, or farther than"),
        ("a.obj", SEAM + "f 1 2 9\n", "triangle 0 names a vertex beyond the 4"),
        ("a.obj", SEAM + "f 1/1 2/2 3/7\n", "triangle 0 names a texture coordinate beyond the 6"),
        ("a.obj", SEAM + "f 1/1 2/2 3/-7\n", "line 12"),
        ("a.obj", SEAM + "f 1 2 3 4 1\n", "face 0 has 5 corners: triangulate"),
    ],
)
def test_a_bad_file_is_named_with_what_is_wrong(tmp_path, capfd, name, text, message):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(MeshError, match=message) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    printed = capfd.readouterr()
    assert printed.out == printed.err == ""


def test_a_sequence_follows_the_numbers_in_its_names(tmp_path):
    positions, faces = sphere(1)
    for k in (8, 12, 10, 6):
        write(tmp_path / "walk" / f"body_{k}.ply", positions + k, faces)
    (tmp_path / "walk" / "notes.txt").write_text("not a mesh")
    (tmp_path / "walk" / "._body_8.ply").write_bytes(b"\0\5\x16\7of macOS")
    for pattern in (tmp_path / "walk", tmp_path / "walk" / "body_*.ply"):
        moving, first = read_sequence(pattern)
        assert moving.shape == (4, len(positions), 3)
        np.testing.assert_allclose(moving[:, 0, 0] - positions[0, 0], [6, 8, 10, 12], atol=1e-6)
        np.testing.assert_array_equal(first.faces, faces)
    still, _ = read_sequence(tmp_path / "walk" / "body_10.ply")
    assert still.shape == (1, len(positions), 3)


def test_a_sequence_that_does_not_correspond_is_refused(tmp_path):
    positions, faces = sphere(1)
    for folder, other, others in (("a", "1.obj", np.roll(faces, 1, axis=0)), ("b", "1.ply", faces)):
        write(tmp_path / folder / "0.obj", positions, faces)
        write(tmp_path / folder / other, positions, others)
    for pattern, message in (
        ("a", r"1\.obj: other vertices or faces than 0\.obj: a sequence needs one numbering"),
        ("b", r"several kinds \(\.obj, \.ply\)"),
        ("x_*.obj", "no mesh: quote a pattern"),
    ):
        with pytest.raises(MeshError, match=message):
            read_sequence(tmp_path / pattern)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (
            "w1.obj w2.obj w4.obj",
            r"w4\.obj: its number is 2 above that of w2\.obj, and others follow by 1",
        ),
        ("w00.obj w03.obj w04.obj w05.obj", r"w03\.obj: its number is 3 above that of w00\.obj"),
        ("w1.obj w01.obj w2.obj w3.obj", "its number is 0 above that of"),
        ("rest.obj w1.obj w2.obj", r"rest\.obj: differs from w2\.obj in more than a number"),
        ("a1_1.obj a1_2.obj a2_1.obj", r"a1_1\.obj: differs from a2_1\.obj in more than a number"),
    ],
)
def test_a_sequence_with_a_gap_or_a_stranger_is_refused(tmp_path, names, message):
    for name in names.split():
        write(tmp_path / "walk" / name, *sphere(1))
    for pattern in (tmp_path / "walk", tmp_path / "walk" / "*.obj"):
        with pytest.raises(MeshError, match=message):
            read_sequence(pattern)


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
    joined = join_seams(Surface(twice, split, uv=chart))
    np.testing.assert_array_equal(joined.positions, positions)
    np.testing.assert_array_equal(joined.faces, faces)
    cloth = Cloth(joined.positions, joined.faces, rest_uv=rest_chart(joined, 1.0))
    np.testing.assert_allclose(cloth.edge_lengths, Cloth(positions, faces).edge_lengths, rtol=1e-12)


def in_face(face, value):
    return lambda uv: np.where(np.arange(len(uv))[:, None, None] == face, value, uv)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda uv: None, "has no UV"),
        (in_face(7, np.nan), "triangle 7 has a corner"),
        (in_face(4, 0.0), "triangle 4 has no area"),
        (lambda uv: uv / 0.25, r"uv_scale=0\.25 makes them equal"),
        # Each triangle lies along its own axes.
        (lambda uv: uv * [4.0, 0.25], "that is a texture and no pattern"),
    ],
)
def test_a_chart_that_is_no_pattern_is_refused(spoil, message):
    with pytest.raises(MeshError, match=message):
        rest_chart(Surface(*SHEET, uv=spoil(own_chart(*SHEET))), 1.0)
