"""Curvature metric on surfaces whose curvature is known: it has to be right before it is used."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import cylinder_patch, icosphere, rectangle, torus
from benchmarks.metrics.curvature import boundary_mask, mean_curvature
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import order

SECOND_ORDER = known_answer(expected=2.0, tolerance=0.1, reason="mixed Voronoi areas are second order there")


@known_answer(expected=0.0, tolerance=1e-4, reason="second order in cells of a tenth of the radius")
def curvature_sphere() -> float:
    """Return the largest relative error of H on a sphere of 642 vertices, 5-valent ones included."""
    radius = 0.25
    x, faces = icosphere(3, radius)
    return float(np.abs(mean_curvature(x, faces)[0] * radius - 1.0).max())


@SECOND_ORDER
def curvature_torus_order() -> float:
    """Return the order in h of the largest error of H on a torus."""

    def error(cells: int) -> float:
        x, faces, exact = torus(cells, 0.3, 0.1)
        return float(np.abs(mean_curvature(x, faces)[0] - exact).max())

    return order(error, (24, 48, 96))


@SECOND_ORDER
def curvature_sphere_order() -> float:
    """Return the order in h of the largest error of H on a band of a sphere, right triangles along parallels.

    On triangles that are all nearly alike, as an icosahedron's, the error falls faster still.
    """

    def error(cells: int) -> float:
        flat, faces = rectangle("right", cells, cells, 2.0, 1.6)
        u, v = flat[:, 0], flat[:, 1] - 0.8
        x = np.stack([np.cos(v) * np.sin(u), np.sin(v), np.cos(v) * np.cos(u)], axis=1)
        return _inner_error(x, faces, 1)

    return order(error, (12, 24, 48))


@SECOND_ORDER
def curvature_cylinder_order() -> float:
    """Return the order in h of the largest error of H on a cylinder, no edge along the circle."""

    def error(cells: int) -> float:
        flat, faces = rectangle("right", cells, cells, 1.0, 1.0)
        along, around = (flat @ np.array([[0.8, 0.6], [-0.6, 0.8]])).T
        return _inner_error(np.stack([np.sin(around), np.cos(around), along], axis=1), faces, 2)

    return order(error, (12, 24, 48))


def _inner_error(x: np.ndarray, faces: np.ndarray, radius: float) -> float:
    """Return the largest relative error of H at interior vertices where it is 1 / radius."""
    inside = ~boundary_mask(faces, len(x))
    return float(np.abs(mean_curvature(x, faces)[0][inside] * radius - 1).max())


@known_answer(unit="1/m", expected=5.0, tolerance=1e-9, reason="exact for vertices on a circle; round-off")
def curvature_cylinder() -> float:
    """Return the mean of H over interior vertices of a cylinder of radius 0.1 m: 1/(2 R) = 5."""
    x, faces = cylinder_patch(40, 0.1)
    curvature, area = mean_curvature(x, faces)
    inside = ~boundary_mask(faces, len(x))
    return float(np.average(curvature[inside], weights=area[inside]))
