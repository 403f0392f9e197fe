"""Kernels of contact in training against their definitions."""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.surface import vertex_normals
from snug.kernels.contact import byte_normals
from tests.reference_sim.meshes import sphere


def test_normals_of_more_frames_than_lanes_are_those_of_each():
    vertices, faces = sphere(2, 0.1)
    moved = vertices + np.random.default_rng(0).normal(scale=0.01, size=(21, *vertices.shape))
    normals = byte_normals(moved.astype(np.float32), faces.astype(np.int32))
    exact = 127 * np.array([vertex_normals(frame, faces) for frame in moved])
    assert normals.dtype == np.int8 and np.abs(normals - exact).max() < 0.5 + 1e-3
