"""The curvature metric on surfaces whose curvature is known: it has to be right before it judges."""

from __future__ import annotations

import numpy as np

from ..metrics.curvature import boundary_mask, mean_curvature
from .meshes import cylinder_patch, icosphere, torus


def sphere_curvature() -> float:
    """Largest relative error of H over the vertices of a sphere, the twelve 5-valent ones included."""
    radius = 0.25
    x, faces = icosphere(3, radius)
    return float(np.abs(mean_curvature(x, faces)[0] * radius - 1.0).max())


def torus_order() -> float:
    """Observed order of the largest error of H when the cells of a torus are halved."""
    errors = []
    for cells in (24, 48):
        x, faces, exact = torus(cells, 0.3, 0.1)
        errors.append(np.abs(mean_curvature(x, faces)[0] - exact).max())
    return float(np.log2(errors[0] / errors[1]))


def cylinder_curvature() -> float:
    """Mean of H over interior vertices [1/m] of a cylinder of radius 0.1 m: 1/(2 R) = 5."""
    x, faces = cylinder_patch(40, 0.1)
    curvature, area = mean_curvature(x, faces)
    inside = ~boundary_mask(faces, len(x))
    return float(np.average(curvature[inside], weights=area[inside]))
