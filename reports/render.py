"""Pictures of garments on the body, side by side for every method at the same frame.

OpenGL is used through pyvista where it works. On a machine without a GL library the plotter does not
raise but kills its process, so the views are made in a process of their own; when that one does not
come back with all of them, a painter that needs matplotlib alone makes them instead.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, file_name, new_figure, save, wrapped
from reports.numbers import number
from reports.painter import paint
from reports.vtkhdf import MeshSeries, read_series

SIZE = (420, 520)  # pixels of one view
BODY_COLOUR = "#D9CFC6"
CLOTH_COLOUR = "#7FA8C9"
GL_SECONDS = 20.0, 1.5  # to start pyvista, and for each view; some drivers hang rather than crash
LETTERS = 15  # of a view's title in an inch
PER_ROW = 6  # of up to so many views; more share as few rows as there have to be evenly


@dataclass(frozen=True)
class View:
    """One picture to take: files, frame, where the camera looks [m] and how much height it sees [m]."""

    garment: str
    body: str  # empty: no body
    frame: int
    centre: tuple[float, float, float]
    height: float
    image: str


@dataclass(frozen=True)
class Camera:
    """An orthographic camera: unit axes of the picture and the middle of what it sees [m]."""

    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray  # from the scene to the camera
    centre: np.ndarray
    height: float


def camera_of(view: View) -> Camera:
    """From the front, a little to the left and above: y is up and the body faces +z."""
    side, lift = np.radians(25.0), np.radians(8.0)
    towards = np.array([np.sin(side) * np.cos(lift), np.sin(lift), np.cos(side) * np.cos(lift)])
    right = np.array([np.cos(side), 0.0, -np.sin(side)])
    return Camera(right, np.cross(towards, right), towards, np.array(view.centre), view.height)


def render_views(views: Sequence[View], *, opengl: bool = True) -> str:
    """Take all views; returns which renderer made them, "OpenGL" or "painter"."""
    if opengl and _rendered_by_opengl(views):
        return "OpenGL"
    for view in views:
        body = read_series(Path(view.body)) if view.body else None
        garment = read_series(Path(view.garment))
        meshes = [(garment.positions(view.frame), garment.faces, CLOTH_COLOUR, 0.03)]
        if body:
            meshes.append((body.positions(view.frame), body.faces, BODY_COLOUR, 0.0))
        paint(meshes, camera_of(view), SIZE, Path(view.image))
    return "painter"


def _rendered_by_opengl(views: Sequence[View]) -> bool:
    """Whether a process of its own made every picture; a crash of it is an answer, not an error."""
    with tempfile.TemporaryDirectory() as folder:
        jobs = Path(folder) / "views.json"
        jobs.write_text(json.dumps([asdict(view) for view in views]), encoding="utf-8")
        command = [sys.executable, "-m", "reports.render", str(jobs)]
        try:
            limit = GL_SECONDS[0] + GL_SECONDS[1] * len(views)
            ended = subprocess.run(command, capture_output=True, timeout=limit)
        except (OSError, subprocess.TimeoutExpired):
            return False
    return ended.returncode == 0 and all(Path(view.image).is_file() for view in views)


def _opengl_views(jobs: Path) -> None:
    """The body of that process: one plotter, one picture per view."""
    import pyvista

    for raw in json.loads(jobs.read_text(encoding="utf-8")):
        view = View(**raw)
        plotter = pyvista.Plotter(off_screen=True, window_size=list(SIZE), lighting="three lights")
        plotter.background_color = pyvista.Color("white")
        for name, colour in ((view.body, BODY_COLOUR), (view.garment, CLOTH_COLOUR)):
            if name:
                series = read_series(Path(name))
                mesh = pyvista.PolyData.from_regular_faces(series.positions(view.frame), series.faces)
                plotter.add_mesh(mesh, color=colour, smooth_shading=True, specular=0.1, ambient=0.15)
        camera = camera_of(view)
        plotter.camera.position = tuple(camera.centre + 5.0 * camera.towards)
        plotter.camera.focal_point = tuple(camera.centre)
        plotter.camera.up = tuple(camera.up)
        plotter.camera.enable_parallel_projection()
        plotter.camera.parallel_scale = camera.height / 2.0
        plotter.reset_camera_clipping_range()
        plotter.renderer.enable_anti_aliasing("ssaa")
        plotter.screenshot(view.image)
        plotter.close()


def chosen_frame(series: dict[str, MeshSeries]) -> int:
    """The frame worth looking at: where the simulation's inertia term is largest, else the middle one.

    The first fifth is left out, in which a method may still be settling.
    """
    frames = min(mesh.frames for mesh in series.values())
    reference = series.get(palette.REFERENCE)
    inertia = reference.fields.get("energy/inertia") if reference else None
    if inertia is None:
        return frames // 2
    first = frames // 5
    return first + int(np.argmax(np.nan_to_num(inertia[first:frames])))


def look_at(mesh: MeshSeries, frame: int) -> tuple[tuple[float, float, float], float]:
    """The middle of a garment and the height of a picture that holds it with some of its body."""
    x = mesh.positions(frame)
    low, high = x.min(axis=0), x.max(axis=0)
    x_middle, y_middle, z_middle = (float(value) for value in (low + high) / 2.0)
    width = float(np.hypot(high[0] - low[0], high[2] - low[2]))
    return (x_middle, y_middle, z_middle), 1.1 * max(float(high[1] - low[1]), width * SIZE[1] / SIZE[0]) + 0.1


@dataclass(frozen=True)
class Dressed:
    """What was kept of one scene: a trajectory per method and, where there is one, its body."""

    scene: str
    series: dict[str, MeshSeries]
    body: MeshSeries | None


def side_by_side(folder: Path, dressed: Sequence[Dressed], *, opengl: bool = True) -> list[Picture]:
    """One picture per scene: a view per method, all at the same frame from the same place."""
    if not dressed:
        return []
    parted = [_whole(scene) for scene in dressed]
    with tempfile.TemporaryDirectory() as scratch:
        planned = [_views_of(scene, Path(scratch) / str(place)) for place, (scene, _) in enumerate(parted)]
        renderer = render_views([view for views in planned for view in views], opengl=opengl)
        return [
            _compose(folder, scene, views, ended, renderer) for (scene, ended), views in zip(parted, planned)
        ]


def _whole(dressed: Dressed) -> tuple[Dressed, list[str]]:
    """The scene without the methods that ended early, and those."""
    last = max(mesh.frames for mesh in dressed.series.values())
    ended = [method for method, mesh in dressed.series.items() if mesh.frames < last]
    whole = {method: mesh for method, mesh in dressed.series.items() if method not in ended}
    return replace(dressed, series=whole), ended


def _views_of(dressed: Dressed, scratch: Path) -> list[View]:
    scratch.mkdir()
    methods = palette.leading(dressed.series)
    body = {"": dressed.body} if dressed.body else {}
    frame = chosen_frame(dressed.series | body)
    centre, height = look_at(dressed.series[methods[0]], frame)
    skin = str(dressed.body.path) if dressed.body else ""
    return [
        View(str(dressed.series[method].path), skin, frame, centre, height, str(scratch / f"{place}.png"))
        for place, method in enumerate(methods)
    ]


def _compose(
    folder: Path, dressed: Dressed, views: Sequence[View], ended: Sequence[str], renderer: str
) -> Picture:
    """The views of one scene in rows, each under its method's name in its method's colour."""
    from matplotlib.image import imread

    lines = -(-len(views) // PER_ROW)
    columns = -(-len(views) // lines)
    width = min(PAGE_WIDTH, columns * 1.6)
    methods = palette.leading(dressed.series)
    titles = [wrapped(palette.label(method), round(LETTERS * width / columns)) for method in methods]
    room = 0.2 * max(title.count("\n") for title in titles) + 0.25
    figure = new_figure(width, lines * (width / columns * SIZE[1] / SIZE[0] + room))
    panels = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in panels:
        axes.set_axis_off()
    for axes, method, title, view in zip(panels, methods, titles, views):
        axes.imshow(imread(view.image))
        axes.set_title(title, color=palette.style(method).colour, fontsize=9)
    frame = views[0].frame
    time = float(next(iter(dressed.series.values())).times[frame])
    caption = f"{dressed.scene}: frame {frame} (t = {number(time)} s), "
    by_inertia = _by_inertia(dressed.series)
    caption += "where the simulation's inertia term is largest." if by_inertia else "the middle."
    if ended:
        names = ", ".join(palette.label(method) for method in palette.ordered(ended))
        caption += f" Not shown, for they ended before their last frame: {names}."
    if renderer == "painter":
        caption += " Drawn without OpenGL, which did not start here."
    name = f"frames_{file_name(dressed.scene)}"
    return save(figure, folder, name, caption=caption, section="garments", kind="frames", vector=False)


def _by_inertia(series: dict[str, MeshSeries]) -> bool:
    reference = series.get(palette.REFERENCE)
    return reference is not None and "energy/inertia" in reference.fields


if __name__ == "__main__":
    _opengl_views(Path(sys.argv[1]))
