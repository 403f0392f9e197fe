"""Curvature metric on surfaces whose curvature is known: it has to be right before it is used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.meshes import cylinder_patch, icosphere, rectangle, torus
from benchmarks.metrics.curvature import boundary_mask, mean_curvature
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import order


@known_answer(expected=0.0, tolerance=1e-4, reason="second order in cells of a tenth of the radius")
def curvature_sphere() -> float:
    """Return the largest relative error of H on a sphere of 642 vertices, 5-valent ones included."""
    radius = 0.25
    x, faces = icosphere(3, radius)
    return float(np.abs(mean_curvature(x, faces)[0] * radius - 1.0).max())


def sphere_band(cells: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return right triangles along parallels of the unit sphere, and their H.

    On triangles that are all nearly alike, as an icosahedron's, the error falls faster still.
    """
    flat, faces = rectangle("right", cells, cells, 2.0, 1.6)
    u, v = flat[:, 0], flat[:, 1] - 0.8
    return np.stack([np.cos(v) * np.sin(u), np.sin(v), np.cos(v) * np.cos(u)], axis=1), faces, 1.0


def twisted_cylinder(cells: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return right triangles on a cylinder of radius 1/2, no edge along its circles, and their H."""
    flat, faces = rectangle("right", cells, cells, 1.0, 1.0)
    along, around = (flat @ np.array([[0.8, 0.6], [-0.6, 0.8]])).T
    return 0.5 * np.stack([np.sin(around), np.cos(around), along], axis=1), faces, 1.0


SURFACES: dict[str, tuple[Callable[[int], tuple], int]] = {  # and the fewest cells
    "torus": (lambda cells: torus(cells, 0.3, 0.1), 24),
    "sphere": (sphere_band, 12),
    "cylinder": (twisted_cylinder, 12),
}


@known_answer(
    {f"curvature_{surface}_order": {"surface": surface} for surface in SURFACES},
    expected=2.0, tolerance=0.1, reason="mixed Voronoi areas are second order there",
)  # fmt: skip
def curvature_order(surface: str) -> float:
    """Return the order in h of the largest error of H at interior vertices of a surface."""
    make, fewest = SURFACES[surface]

    def error(cells: int) -> float:
        x, faces, exact = make(cells)
        return float(np.abs(mean_curvature(x, faces)[0] - exact)[~boundary_mask(faces, len(x))].max())

    return order(error, (fewest, 2 * fewest, 4 * fewest))


@known_answer(
    unit="1/m", expected=5.0, tolerance=1e-9, reason="exact for vertices on a circle; round-off"
)
def curvature_cylinder() -> float:
    """Return the mean of H over interior vertices of a cylinder of radius 0.1 m: 1/(2 R) = 5."""
    x, faces = cylinder_patch(40, 0.1)
    curvature, area = mean_curvature(x, faces)
    inside = ~boundary_mask(faces, len(x))
    return float(np.average(curvature[inside], weights=area[inside]))
