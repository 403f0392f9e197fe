"""Picture of a garment on the unposed body, from the front and from the side.

Drawn with matplotlib, triangles painted back to front: no OpenGL is needed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference_sim.files.mesh_files import Surface
from snug.body.parametric_body import Body

Array = NDArray[np.float64]

BODY, CLOTH, BELOW = (0.85, 0.81, 0.78), (0.50, 0.66, 0.79), (0.85, 0.20, 0.15)
CLOTH_LIFT = 0.03  # [m] that cloth is nearer in the order of painting: it lies on the body
VIEW_MARGIN = 0.1  # [m]
VIEWS = {"front": (0, 1, 2), "left side": (2, 1, 0)}  # axes to the right, up and towards the eye
TURNED = {"left side": -1.0}  # z runs to the left as seen from +x


def draw(path: Path, body: Body, surface: Surface, distances: Array) -> None:
    """Draw a surface on the body and write the picture.

    path: of the picture. distances: (V,) [m] of the vertices to the skin, below 0 in the body.
    """
    from matplotlib.figure import Figure

    below = (distances < 0)[surface.faces].any(axis=1)
    cloth = np.where(below[:, None], BELOW, CLOTH)
    points = np.concatenate([body.template, surface.positions])
    low, high = points.min(axis=0) - VIEW_MARGIN, points.max(axis=0) + VIEW_MARGIN
    figure = Figure(figsize=(9, 6), layout="constrained")
    for axes, (name, view) in zip(figure.subplots(1, len(VIEWS)), VIEWS.items()):
        turn = np.array([TURNED.get(name, 1.0), 1.0, 1.0])
        parts = [
            _shaded(body.template[body.faces][:, :, view] * turn, np.tile(BODY, (len(body.faces), 1)), 0.0),
            _shaded(surface.positions[surface.faces][:, :, view] * turn, cloth, CLOTH_LIFT),
        ]
        _paint(axes, parts)
        axes.set(xlim=sorted(turn[0] * np.array([low, high])[:, view[0]]), ylim=(low[1], high[1]))
        axes.set(aspect="equal", title=f"{name}, {below.mean():.0%} of the triangles below the skin")
        axes.set_axis_off()
    figure.savefig(path, dpi=120)


def _shaded(corners: Array, colours: Array, lift: float) -> tuple[Array, Array, Array]:
    """Return outlines (F,3,2), depths (F,) and lit colours (F,3) of triangles (F,3,3) as seen."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    towards = np.abs(normals[:, 2]) / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)
    return corners[:, :, :2], corners[:, :, 2].mean(axis=1) + lift, colours * (0.4 + 0.6 * towards[:, None])


def _paint(axes: Any, parts: list[tuple[Array, Array, Array]]) -> None:
    from matplotlib.collections import PolyCollection

    corners, depths, colours = (np.concatenate(part) for part in zip(*parts))
    order = np.argsort(depths, kind="stable")
    outlines: Any = corners[order]  # one array, not a list: all outlines are made at once
    shades = colours[order]
    axes.add_collection(PolyCollection(outlines, facecolors=shades, edgecolors=shades, linewidths=0.2))
