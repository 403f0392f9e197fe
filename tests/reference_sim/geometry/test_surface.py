"""Surfaces: winding numbers against libigl, normals of a few corners, and what is not closed."""

from __future__ import annotations

import igl
import numpy as np
import pytest

from reference_sim.cloth import MeshError
from reference_sim.geometry import surface
from reference_sim.geometry.surface import winding_numbers
from reference_sim.geometry.topology import check_closed
from snug import Body
from tests.reference_sim.meshes import sphere


def test_a_body_winds_as_its_solid_angles_say():
    body, random = Body.load(), np.random.default_rng(0)
    x = body.template
    near = x[random.integers(len(x), size=300)] + random.normal(0.0, 0.01, (300, 3))
    points = np.concatenate([near, random.uniform(x.min(axis=0) - 0.1, x.max(axis=0) + 0.1, (200, 3))])
    windings = winding_numbers(x, body.faces, points)
    angles = igl.winding_number(*map(np.asfortranarray, (x, body.faces, points)))
    assert 0 < (windings > 0).sum() < len(windings)
    assert windings.tolist() == np.asarray(angles).ravel().round().tolist()


@pytest.mark.parametrize("longest", [0, 1, 2])
def test_rays_through_sides_and_corners_count_once(longest):
    # An octahedron, whose corners and sides lie before one another along every axis.
    corners, faces = sphere(0)
    grid = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 9)], indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.abs(grid).sum(axis=1) != 1.0]  # a point on the surface is on neither side
    scale = np.where(np.arange(3) == longest, 1.0, 0.5)
    inside = np.abs(grid).sum(axis=1) < 1.0
    assert winding_numbers(corners * scale, faces, grid * scale).tolist() == inside.astype(int).tolist()


def test_normals_of_some_corners_are_those_of_the_whole_mesh_to_the_bit() -> None:
    positions, faces = sphere(3, 0.1)
    positions = positions + np.random.default_rng(0).normal(0, 0.005, positions.shape)
    some = np.array([3, 4, 3, 77])
    around = surface.faces_around(faces, len(positions))
    normals = surface.normals_of_corners(some, positions, faces, *around)[faces[some]]
    assert np.array_equal(normals, surface.vertex_normals(positions, faces)[faces[some]])


BALL, FACES = sphere(1)
TURNED = np.where(np.arange(len(FACES))[:, None] == 3, FACES[:, ::-1], FACES)


def with_vertex(frame: int, vertex: int, place) -> np.ndarray:
    moving = np.stack([BALL, BALL, BALL])
    moving[frame, vertex] = place
    return moving


@pytest.mark.parametrize(
    ("positions", "faces", "message"),
    [
        (BALL, FACES, r"expected \(T, B, 3\) and \(F, 3\)"),
        (BALL[None], FACES + 1, r"vertex outside 0\.\.17"),
        (BALL[None], FACES + 0.5, "vertex outside"),
        (with_vertex(1, 4, np.nan), FACES, "vertex 4 of frame 1 is not finite"),
        (with_vertex(2, FACES[5, 0], BALL[FACES[5, 1]]), FACES, "has no area in frame 2: remove it"),
        (BALL[None], FACES[1:], r"not closed: edge \(\d+, \d+\) of face \d+ has one face only: fill"),
        (BALL[None], TURNED, r"not closed: faces \d+ and \d+ walk edge \(\d+, \d+\) the same way"),
        (BALL[None], FACES[:, ::-1], "inside out .*reverse its faces"),
    ],
)
def test_what_is_no_closed_surface(positions, faces, message):
    with pytest.raises(MeshError, match=message):
        check_closed(positions, faces)
