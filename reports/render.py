"""Pictures of garments on the body, side by side for every method at the same frame.

Drawn with matplotlib alone, triangles painted back to front: no OpenGL is needed, whose drivers kill the
process where there is no display, and every machine gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reports.data import Run
from reports.numbers import number
from reports.plotting import PAGE_WIDTH, Picture, file_name, new_figure, save, wrapped
from reports.styles import leading, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from reference_sim.trajectory import Trajectory

BODY_COLOUR = "#D9CFC6"
CLOTH_COLOUR = "#7FA8C9"
LIGHT = (0.35, 0.45, 0.82)  # towards the light, in the camera's axes: right, up, towards
TALL = 1.24  # height of a view over its width
LIFT = 0.03  # [m] that cloth is nearer in the order of painting: about a triangle, for it lies on the body
LETTERS = 15  # of a view's title in an inch
PER_ROW = 6  # of up to so many views; more share as few rows as there have to be evenly
INERTIA = "energy/inertia"


@dataclass(frozen=True)
class Camera:
    """An orthographic camera: the middle [m] and the height [m] of what it sees, from the front, a little to
    the left and above; y is up and the body faces +z.
    """

    centre: np.ndarray
    height: float

    def seen(self, positions: np.ndarray) -> np.ndarray:
        """(V,3) [m] -> (V,3): right, up and towards the camera, from the middle of the picture [m]."""
        side, lift = np.radians(25.0), np.radians(8.0)
        towards = np.array([np.sin(side) * np.cos(lift), np.sin(lift), np.cos(side) * np.cos(lift)])
        right = np.array([np.cos(side), 0.0, -np.sin(side)])
        return (positions - self.centre) @ np.stack([right, np.cross(towards, right), towards], axis=1)


def camera_for(positions: np.ndarray) -> Camera:
    """One that sees all of a garment, positions (V,3) [m], with some of its body."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    width = float(np.hypot(high[0] - low[0], high[2] - low[2]))
    return Camera((low + high) / 2.0, 1.1 * max(float(high[1] - low[1]), width * TALL) + 0.1)


def paint(axes: Axes, meshes: list[tuple[np.ndarray, np.ndarray, str, float]], camera: Camera) -> None:
    """Draw meshes (positions (V,3) [m], faces (F,3), colour, lift [m]), triangles in order of their depth."""
    from matplotlib.collections import PolyCollection

    parts = [_shaded(camera.seen(x)[faces], colour, lift) for x, faces, colour, lift in meshes]
    corners, depths, colours = (np.concatenate(part) for part in zip(*parts))
    order = np.argsort(depths)
    # One array, not a list: matplotlib then makes all outlines at once.
    polygons: Any = corners[order]
    painted = PolyCollection(polygons, facecolors=colours[order], edgecolors=colours[order], linewidths=0.2)
    painted.set_in_layout(False)
    axes.add_collection(painted)
    half = camera.height / 2.0
    axes.set(xlim=(-half / TALL, half / TALL), ylim=(-half, half), aspect="equal")
    axes.set_axis_off()


def _shaded(corners: np.ndarray, colour: str, lift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles (F,3,3) in camera axes -> outlines (F,3,2), depths (F,), colours (F,3), lit on both sides."""
    from matplotlib.colors import to_rgb

    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    brightness = 0.45 + 0.6 * np.clip(normals @ light, 0.0, 1.0)
    shade = np.clip(brightness[:, None] * np.array(to_rgb(colour)), 0.0, 1.0)
    return corners[:, :, :2], corners[:, :, 2].mean(axis=1) + lift, shade


def chosen_frame(series: Mapping[str, Trajectory], reference: str) -> tuple[int, str]:
    """The frame worth looking at, and why: where the simulation's inertia is largest, else the middle one.

    The first fifth is left out, in which a method may still be settling.
    """
    frames = min(mesh.frames for mesh in series.values())
    inertia = series[reference].frame_fields.get(INERTIA) if reference in series else None
    if inertia is None:
        return frames // 2, "the middle"
    first = frames // 5
    most = first + int(np.argmax(np.nan_to_num(inertia[first:frames])))
    return most, "where the simulation's inertia term is largest"


def side_by_side(
    folder: Path, run: Run, scene: str, series: Mapping[str, Trajectory], body: Trajectory | None
) -> Picture:
    """One picture of a scene: a view per method, all at the same frame from the same place."""
    last = max(mesh.frames for mesh in series.values())
    ended = run.ordered(method for method, mesh in series.items() if mesh.frames < last)
    methods = leading(run, series.keys() - set(ended))
    whole = {method: series[method] for method in methods}
    frame, why = chosen_frame(whole | ({"": body} if body else {}), run.reference)
    camera = camera_for(whole[methods[0]].positions[frame])
    behind = [(body.positions[frame], body.faces, BODY_COLOUR, 0.0)] if body else []
    lines = -(-len(methods) // PER_ROW)
    columns = -(-len(methods) // lines)
    width = min(PAGE_WIDTH, columns * 1.6)
    titles = [wrapped(run.label(method), round(LETTERS * width / columns)) for method in methods]
    room = 0.2 * max(title.count("\n") for title in titles) + 0.25
    figure = new_figure(width, lines * (width / columns * TALL + room))
    panels = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in panels[len(methods) :]:
        axes.set_axis_off()
    for axes, method, title in zip(panels, methods, titles):
        paint(
            axes, [*behind, (whole[method].positions[frame], whole[method].faces, CLOTH_COLOUR, LIFT)], camera
        )
        axes.set_title(title, color=style(run, method).colour, fontsize=9)
    caption = f"{scene}: frame {frame} (t = {number(float(whole[methods[0]].times[frame]))} s), {why}."
    if ended:
        names = ", ".join(map(run.label, ended))
        caption += f" Not shown, for they ended before their last frame: {names}."
    name = f"frames_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, kind="frames", vector=False)
