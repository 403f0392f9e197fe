"""Curvature metric on surfaces whose curvature is known: it has to be right before it is used."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import cylinder_patch, icosphere, rectangle, torus
from benchmarks.metrics.curvature import boundary_mask, mean_curvature
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import fitted_order

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
    errors = []
    for cells in (24, 48, 96):
        x, faces, exact = torus(cells, 0.3, 0.1)
        errors.append(float(np.abs(mean_curvature(x, faces)[0] - exact).max()))
    return fitted_order(errors, [1 / cells for cells in (24, 48, 96)])


@SECOND_ORDER
def curvature_sphere_order() -> float:
    """Return the order in h of the largest error of H on a band of a sphere, right triangles along parallels.

    On triangles that are all nearly alike, as an icosahedron's, the error falls faster still.
    """
    errors, sizes = [], (12, 24, 48)
    for cells in sizes:
        flat, faces = rectangle("right", cells, cells, 2.0, 1.6)
        u, v = flat[:, 0], flat[:, 1] - 0.8
        x = np.stack([np.cos(v) * np.sin(u), np.sin(v), np.cos(v) * np.cos(u)], axis=1)
        inside = ~boundary_mask(faces, len(x))
        errors.append(float(np.abs(mean_curvature(x, faces)[0][inside] - 1).max()))
    return fitted_order(errors, [1 / cells for cells in sizes])


@SECOND_ORDER
def curvature_cylinder_order() -> float:
    """Return the order in h of the largest error of H on a cylinder, no edge along the circle."""
    errors, sizes = [], (12, 24, 48)
    for cells in sizes:
        flat, faces = rectangle("right", cells, cells, 1.0, 1.0)
        x = _wrapped(flat @ np.array([[0.8, 0.6], [-0.6, 0.8]]))
        inside = ~boundary_mask(faces, len(x))
        errors.append(float(np.abs(mean_curvature(x, faces)[0][inside] * 2 - 1).max()))
    return fitted_order(errors, [1 / cells for cells in sizes])


@known_answer(unit="1/m", expected=5.0, tolerance=1e-9, reason="exact for vertices on a circle; round-off")
def curvature_cylinder() -> float:
    """Return the mean of H over interior vertices of a cylinder of radius 0.1 m: 1/(2 R) = 5."""
    x, faces = cylinder_patch(40, 0.1)
    curvature, area = mean_curvature(x, faces)
    inside = ~boundary_mask(faces, len(x))
    return float(np.average(curvature[inside], weights=area[inside]))


def _wrapped(flat: np.ndarray) -> np.ndarray:
    """Return points (V,2) of the plane rolled onto a cylinder of radius 1: (V,3)."""
    return np.stack([np.sin(flat[:, 1]), np.cos(flat[:, 1]), flat[:, 0]], axis=1)
