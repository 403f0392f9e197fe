"""Draws meshes with matplotlib alone: triangles sorted by depth, painted back to front."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from reports.render import Camera

LIGHT = (0.35, 0.45, 0.82)  # towards the light, in the camera's axes: right, up, towards


def paint(
    meshes: Sequence[tuple[np.ndarray, np.ndarray, str, float]],
    camera: Camera,
    size: tuple[int, int],
    image: Path,
) -> None:
    """Write a PNG of `size` pixels showing meshes (positions (V,3) [m], faces (F,3), colour, lift [m]).

    `lift` brings a mesh so much nearer to the camera in the order of painting: triangles are sorted by
    their centroids, so cloth lying on a body needs about the size of a triangle to be painted over it.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    corners, depths, colours = [], [], []
    for positions, faces, colour, lift in meshes:
        seen = _in_camera(positions, camera)[faces]
        flat, depth, shade = _shaded(seen, colour)
        corners.append(flat)
        depths.append(depth + lift)
        colours.append(shade)
    order = np.argsort(np.concatenate(depths))
    figure = Figure(figsize=(size[0] / 100.0, size[1] / 100.0), dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    half = camera.height / 2.0
    axes.set(xlim=(-half * size[0] / size[1], half * size[0] / size[1]), ylim=(-half, half))
    paints = np.concatenate(colours)[order]
    # One array, not a list: matplotlib then makes all outlines at once.
    polygons: Any = np.concatenate(corners)[order]
    axes.add_collection(PolyCollection(polygons, facecolors=paints, edgecolors=paints, linewidths=0.3))
    FigureCanvasAgg(figure).print_png(image, metadata={"Software": None})


def _in_camera(positions: np.ndarray, camera: Camera) -> np.ndarray:
    """(V,3): right, up and towards the camera, from the middle of the picture [m]."""
    axes = np.stack([camera.right, camera.up, camera.towards], axis=1)
    return (positions - camera.centre) @ axes


def _shaded(corners: np.ndarray, colour: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles (F,3,3) in camera axes -> outlines (F,3,2), depths (F,), colours (F,3), lit on both sides."""
    from matplotlib.colors import to_rgb

    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    brightness = 0.45 + 0.6 * np.clip(normals @ light, 0.0, 1.0)
    shade = np.clip(brightness[:, None] * np.array(to_rgb(colour)), 0.0, 1.0)
    return corners[:, :, :2], corners[:, :, 2].mean(axis=1), shade
