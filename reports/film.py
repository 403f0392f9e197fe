"""python -m reports.film RUN: a film of methods side by side in a scene, from one camera."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import demand_writable_folder, replacing
from reports.rendering import camera_axes

if TYPE_CHECKING:
    from reference_sim.trajectory import Trajectory
    from reports.run.reading import SelectedRollOuts

EXAMPLES = """examples:
  python -m reports.film reports/runs/NAME --scene tshirt/kick --methods simulation,snug -o kick.mp4
  python -m reports.film reports/runs/NAME --scene flag --methods simulation,newton-1,xpbd-40 -o flag.gif
  python -m reports.film reports/runs/NAME --scene tshirt/punch --methods snug,pbns --speed 0.25 -o punch.mp4
  python -m reports.film reports/runs/NAME --scene tshirt/kick --methods snug -o kick.pc2

A .pc2 is no film: it gives kick_snug.pc2 and kick_body.pc2, the vertices of each method and of the body, with
an .obj each, in metres, y up, for Blender's Mesh Cache modifier.

An .mp4 needs pip install 'neural-garment-benchmark[film]'; a .gif does not. No screen is needed.
The camera goes along with the garment; a roll-out that ended early keeps its last frame and says so.
exit status: 0 written; 2 the run has no such roll-out, or no film can be made here: one line says why."""
CLOTH, BODY, PAPER, INK = "#D9694A", "#CFC9C2", "#F4F2EE", (40, 40, 40)
PER_ROW = 4
TALL = 1.25  # height of a view over its width
ANGLE = 18.0  # [degrees] of the perspective, over the height of a view
SMOOTHED = 0.6  # [s] over which the camera's path is smoothed
MARGIN = 1.25  # around the garment
MOST_RATE = 50.0  # frames a second of a GIF that browsers show in their time
SWATCH = "import pyvista; pyvista.Plotter(off_screen=True, window_size=(8, 8)).screenshot()"


class Stage:
    """Stage with all cloths and the body, one cloth shown at a time: every view has the same camera."""

    def __init__(self, selected: SelectedRollOuts, width: int, azimuth: float) -> None:
        import pyvista
        from vtkmodules.vtkCommonCore import vtkLogger

        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # that there is no screen
        self.selected, self.axes = selected, camera_axes(-azimuth)
        self.width, self.height = width - width % 2, round(width * TALL / 2) * 2
        size = [self.width, self.height]
        self.plotter: Any = pyvista.Plotter(off_screen=True, window_size=size, lighting="none")
        self.plotter.background_color = pyvista.Color(PAPER)
        # Nearly along the cloth from the side: folds of millimetres throw shade.
        for place, strength in (((1.7, 0.8, 0.6), 1.0), ((-1.2, 0.6, 1.6), 0.4)):
            self.plotter.add_light(
                pyvista.Light(position=place, intensity=strength, light_type="camera light")
            )
        self.meshes = {name: self._added(cloth, CLOTH) for name, cloth in selected.cloths.items()}
        self.body = self._added(selected.body, BODY) if selected.body else None
        self.drawn = -1  # frame of the body
        self.centres, half = camera_path(selected, self.axes)
        self.away = half / np.tan(np.radians(ANGLE / 2.0))

    def _added(self, cloth: Trajectory, colour: str) -> tuple[Any, Any]:
        """Add a cloth or body; return its mesh and its actor."""
        import pyvista

        mesh = pyvista.PolyData.from_regular_faces(cloth.positions[0], cloth.faces)
        actor = self.plotter.add_mesh(
            mesh, color=colour, ambient=0.15, diffuse=0.9, specular=0.12, specular_power=10
        )
        actor.prop.interpolation = "Phong"
        return mesh, actor

    def view(self, method: str, frame: int) -> np.ndarray:
        """Return (height,width,3) bytes: that method's cloth on the body; past its end, its last frame."""
        for name, (_, actor) in self.meshes.items():
            actor.visibility = name == method
        _move(self.meshes[method][0], self.selected.cloths[method].positions, frame)
        if self.body and self.selected.body and frame != self.drawn:
            _move(self.body[0], self.selected.body.positions, frame)
            self.drawn = frame
        camera, centre = self.plotter.camera, self.centres[frame]
        camera.focal_point, camera.up, camera.view_angle = centre, (0.0, 1.0, 0.0), ANGLE
        camera.position = centre + self.away * self.axes[:, 2]
        self.plotter.renderer.reset_camera_clipping_range()
        self.plotter.render()
        return np.asarray(self.plotter.screenshot(return_img=True))

    def close(self) -> None:
        """Free the renderer."""
        self.plotter.close()


def _move(mesh, positions: np.ndarray, frame: int) -> None:
    from reference_sim.geometry.surface import vertex_normals  # loads numba

    mesh.points = positions[min(frame, len(positions) - 1)].astype(np.float32)
    mesh.point_data.active_normals = vertex_normals(mesh.points.astype(float), mesh.regular_faces)


def camera_path(selected: SelectedRollOuts, axes: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the camera's target in each frame (T,3) [m], smoothed, and half the height that it sees [m]."""
    cloths = selected.cloths.values()
    frames = max(cloth.frames for cloth in cloths)
    seen = [cloth.positions @ axes for cloth in cloths]
    low, high = (
        [np.pad(ends, ((0, frames - len(ends)), (0, 0)), mode="edge") for ends in corners]
        for corners in ([x.min(axis=1) for x in seen], [x.max(axis=1) for x in seen])
    )
    lowest, highest = np.min(low, axis=0), np.max(high, axis=0)
    dt = selected.longest.dt
    reach = 0 if np.isnan(dt) else int(SMOOTHED / dt / 2.0)
    centres = uniform_filter1d((lowest + highest) / 2.0, 2 * reach + 1, axis=0, mode="nearest")
    right, up, _ = np.maximum(highest - centres, centres - lowest).max(axis=0)
    return centres @ axes.T, MARGIN * float(max(up, TALL * right))


def draw_frames(selected: SelectedRollOuts, width: int, azimuth: float) -> Iterator[np.ndarray]:
    """Yield every frame of the film: all views with their names, and the time."""
    stage = Stage(selected, width, azimuth)
    try:
        for frame, time in enumerate(selected.longest.times):
            views = {method: stage.view(method, frame) for method in selected.cloths}
            yield _composed(selected, views, frame, float(time))
    finally:
        stage.close()


def _composed(
    selected: SelectedRollOuts, views: dict[str, np.ndarray], frame: int, time: float
) -> np.ndarray:
    """Compose views in rows, each under its method's name, with the time [s] below them."""
    from matplotlib import get_data_path
    from PIL import Image, ImageDraw, ImageFont

    height, width, _ = next(iter(views.values())).shape
    letter = max(12, width // 22)
    font = ImageFont.truetype(f"{get_data_path()}/fonts/ttf/DejaVuSans.ttf", letter)
    rows = -(-len(views) // PER_ROW)
    columns = -(-len(views) // rows)
    room, foot = (2 * letter) // 2 * 2, (2 * letter) // 2 * 2
    image = Image.new("RGB", (columns * width, rows * (height + room) + foot), PAPER)
    draw = ImageDraw.Draw(image)
    for place, (method, view) in enumerate(views.items()):
        x, y = place % columns * width, place // columns * (height + room)
        image.paste(Image.fromarray(view), (x, y + room))
        cloth = selected.cloths[method]
        label = _fitting(draw, selected.run.label(method), font, width)
        draw.text((x + width / 2, y + room / 2), label, INK, font, anchor="mm")
        if frame >= cloth.frames:
            ended = _fitting(draw, f"ended at {cloth.times[-1]:.2f} s: {cloth.status}", font, width)
            draw.text((x + width / 2, y + room + height - letter), ended, INK, font, anchor="mm")
    draw.text((image.width / 2, image.height - foot / 2), f"{time:.2f} s", INK, font, anchor="mm")
    return np.asarray(image)


def _fitting(draw, label: str, font, width: int) -> str:
    """Cut the label where it is wider than a view."""
    while draw.textlength(label, font) > 0.96 * width and len(label) > 1:
        label = label.rstrip("…")[:-1] + "…"
    return label


def write_mp4(path: Path, frames: Iterable[np.ndarray], rate: float) -> None:
    """Write H.264 at `rate` frames a second."""
    from fractions import Fraction

    import av

    with av.open(str(path), "w") as container:
        stream = None
        for picture in frames:
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1000))
                stream.height, stream.width = picture.shape[:2]
                stream.pix_fmt, stream.options = "yuv420p", {"crf": "18", "threads": "1"}
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        if stream is not None:
            container.mux(stream.encode())


def write_gif(path: Path, frames: Iterable[np.ndarray], rate: float) -> None:
    """Write a GIF whose hundredths of a second add up to the right time, in shades of the film's colours.

    Browsers show a frame for two hundredths or more: of a higher rate every second or third frame is kept.
    """
    from PIL import Image, ImageColor

    step = max(1, math.ceil(round(rate / MOST_RATE, 6)))
    rate /= step
    # Of all frames at once: one picture's own palette has no place for what the others show.
    shades = np.linspace(0.0, 1.3, 126)[:, None]
    colours = [np.minimum(shades * ImageColor.getrgb(colour), 255.0) for colour in (CLOTH, BODY)]
    table = np.concatenate([*colours, [ImageColor.getrgb(PAPER), INK]]).round().astype(np.uint8)
    palette = Image.new("P", (1, 1))
    palette.putpalette(table.tobytes())
    drawn = [
        Image.fromarray(x).quantize(palette=palette, dither=Image.Dither.NONE)
        for x in islice(frames, 0, None, step)
    ]
    ends = [10 * round(100.0 * (k + 1) / rate) for k in range(len(drawn))]
    durations = [end - start for start, end in zip([0, *ends], ends)]
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=durations, loop=0)


def write_point_caches(path: Path, selected: SelectedRollOuts) -> None:
    """Write the vertices of each method, and of the body, as NAME_METHOD.pc2 with an .obj beside it."""
    from reference_sim.trajectory import write_point_cache

    for name, mesh in (selected.cloths | ({"body": selected.body} if selected.body else {})).items():
        write_point_cache(path.with_stem(f"{path.stem}_{name.replace('/', '-')}"), mesh)


WRITERS = {".mp4": write_mp4, ".gif": write_gif}


def demand_possible(path: Path) -> None:
    """Raise ValueError where no such film can be made here."""
    from importlib.util import find_spec

    if path.suffix == ".pc2":
        return
    if path.suffix not in WRITERS:
        raise ValueError(f"{path}: a film ends in .mp4 or .gif, point caches in .pc2")
    if path.suffix == ".mp4" and find_spec("av") is None:
        raise ValueError(f"{path}: needs pip install 'neural-garment-benchmark[film]'; a .gif does not")
    # In a process of its own: where there is no OpenGL, it is killed.
    if subprocess.run([sys.executable, "-c", SWATCH], capture_output=True).returncode:
        raise ValueError(
            "no OpenGL to draw without a screen: install Mesa's (Debian: libegl1, libgl1-mesa-dri)"
        )


@command("reports.film")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.film",
        description="A film of methods side by side in a scene of a run.",
        epilog=EXAMPLES,
    )
    parser.add_argument("run_dir", metavar="RUN", help="folder of a run that has kept its trajectories")
    parser.add_argument("--scene", required=True, help="as in results.csv, say tshirt/kick")
    parser.add_argument("--methods", required=True, metavar="NAME,...", help="as in results.csv")
    parser.add_argument("--seed", type=int, help="of trained methods (default: the first)")
    parser.add_argument("--speed", type=float, default=1.0, help="less than 1 is slow motion (default 1)")
    parser.add_argument("--width", type=int, default=480, help="of a view [pixels] (default 480)")
    parser.add_argument("--azimuth", type=float, default=25.0, metavar="DEGREES",
        help="of the camera, from the front to the body's left (default 25; 180: from behind)")  # fmt: skip
    parser.add_argument("-o", "--out", required=True, metavar="FILE", help="x.mp4, x.gif or x.pc2")
    options = parser.parse_args(arguments)
    path, methods = Path(options.out), [name.strip() for name in options.methods.split(",")]
    if not 0.01 <= options.speed <= 10.0 or not 64 <= options.width <= 2000:
        raise ValueError("--speed is 0.01 to 10, --width 64 to 2000")
    demand_possible(path)
    demand_writable_folder(path.parent)
    from reports.run.reading import select_roll_outs

    selected = select_roll_outs(RunFolder(options.run_dir), options.scene, methods, options.seed)
    if path.suffix == ".pc2":
        write_point_caches(path, selected)
    else:
        dt = selected.longest.dt
        rate = options.speed / dt if dt > 0.0 else 1.0
        with replacing(path) as temporary:
            WRITERS[path.suffix](temporary, draw_frames(selected, options.width, options.azimuth), rate)
    print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
