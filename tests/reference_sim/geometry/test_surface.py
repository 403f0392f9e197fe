"""Normals of a mesh: those of a few faces' corners are those of the whole mesh."""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.surface import faces_around, normals_of_corners, vertex_normals
from tests.reference_sim.meshes import sphere


def test_normals_of_some_corners_are_those_of_the_whole_mesh_to_the_bit() -> None:
    positions, faces = sphere(3, 0.1)
    positions = positions + np.random.default_rng(0).normal(0, 0.005, positions.shape)
    some = np.array([3, 4, 3, 77])
    normals = normals_of_corners(some, positions, faces, *faces_around(faces, len(positions)))
    corners = faces[some]
    assert np.array_equal(normals[corners], vertex_normals(positions, faces)[corners])
