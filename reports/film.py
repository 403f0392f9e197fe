"""python -m reports.film RUN: a film of methods side by side in a scene, from one camera."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d

from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import demand_writable_folder, replacing
from reports.pictures import (
    BODY_COLOUR,
    CLOTH_COLOUR,
    LIFT,
    Camera,
    SceneRollOuts,
    Surface,
    camera_axes,
    views,
)

if TYPE_CHECKING:
    from reference_sim.trajectory import Trajectory

EXAMPLES = """examples:
  python -m reports.film reports/runs/NAME --scene tshirt/kick --methods simulation,snug -o kick.gif
  python -m reports.film reports/runs/NAME --scene flag --methods simulation,newton-1,xpbd-40 -o flag.gif
  python -m reports.film reports/runs/NAME --scene tshirt/punch --methods snug,pbns --speed 0.25 -o punch.gif
  python -m reports.film reports/runs/NAME --scene tshirt/kick --methods snug -o kick.pc2

A .pc2 is no film: it gives kick_snug.pc2 and kick_body.pc2, the vertices of each method and of the body, with
an .obj each, in metres, y up, for Blender's Mesh Cache modifier.

The camera goes along with the garment; a roll-out that ended early keeps its last frame and says so.
exit status: 0 written; 2 the run has no such roll-out: one line says why."""
PAPER, INK = (255, 255, 255), (40, 40, 40)
PER_ROW = 4
TALL = 1.25  # height of a view over its width
SMOOTHED = 0.6  # [s] over which the camera's path is smoothed
MARGIN = 1.25  # around the garment
MOST_RATE = 50.0  # frames a second of a GIF that browsers show in their time


def select_roll_outs(
    folder: RunFolder, scene: str, methods: Sequence[str], seed: int | None = None
) -> SceneRollOuts:
    """Read roll-outs of a scene.

    Args:
        folder: of the run.
        scene: as results.csv names it.
        methods: as results.csv names them.
        seed: of methods that have one; None takes the first that the run has.

    Raises:
        ResultsError: for a roll-out that the run did not keep; the message names those of its scenes.
    """
    from reports.finished_run import read_run

    run = read_run(folder)
    rows = run.frame[(run.frame["case"] == "") & (run.frame["scene"] == scene)]
    cloths = {}
    for method in methods:
        of_method = rows[rows["method"] == method]
        chosen = of_method["seed"].min() if seed is None or not of_method["seeded"].any() else seed
        cloth = run.roll_outs.cloth(scene, method, int(chosen)) if len(of_method) else None
        if cloth is None or not cloth.finite().frames:
            kept = sorted(path.parent.name for path in folder.trajectories.glob("*/*.vtkhdf"))
            reason = (
                "; ".join(run.problems) or f"scenes with roll-outs are {', '.join(dict.fromkeys(kept))}"
            )
            raise ResultsError(f"{folder.path}: no roll-out of '{method}' in {scene}: {reason}")
        cloths[method] = cloth.finite()
    labels = {name: run.label(name) for name in cloths}
    return SceneRollOuts(scene, cloths, run.roll_outs.body(scene), labels)


def camera_path(selected: SceneRollOuts, axes: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the camera's target in each frame (T,3) [m], smoothed, and half the height that it sees [m]."""
    cloths = selected.series.values()
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


def drawn(mesh: Trajectory, frame: int, colour: tuple[float, float, float], lift: float = 0.0) -> Surface:
    """Return a roll-out at that frame, past its end at its last, as it is painted."""
    return Surface(mesh.positions[min(frame, mesh.frames - 1)], mesh.faces, colour, lift)


def draw_frames(selected: SceneRollOuts, width: int, azimuth: float) -> Iterator[np.ndarray]:
    """Yield every frame of the film: all views with their names, and the time."""
    width, height = width - width % 2, round(width * TALL / 2) * 2
    centres, half = camera_path(selected, camera_axes(-azimuth))
    for frame, time in enumerate(selected.longest.times):
        body = drawn(selected.body, frame, BODY_COLOUR) if selected.body else None
        cloths = [drawn(cloth, frame, CLOTH_COLOUR, LIFT) for cloth in selected.series.values()]
        camera = Camera(centres[frame], 2.0 * half, -azimuth)
        pictures = (255.0 * np.array(views(body, cloths, camera, width, height))).astype(np.uint8)
        yield _composed(selected, pictures, frame, float(time))


def _composed(selected: SceneRollOuts, pictures: np.ndarray, frame: int, time: float) -> np.ndarray:
    """Compose pictures (N,H,W,3) in rows, each under its method's name, with the time [s] below them."""
    from matplotlib import get_data_path
    from PIL import Image, ImageDraw, ImageFont

    count, height, width, _ = pictures.shape
    letter = max(12, width // 22)
    font = ImageFont.truetype(f"{get_data_path()}/fonts/ttf/DejaVuSans.ttf", letter)
    rows = -(-count // PER_ROW)
    columns = -(-count // rows)
    room = 2 * letter
    image = Image.new("RGB", (columns * width, rows * (height + room) + room), PAPER)
    draw = ImageDraw.Draw(image)
    for place, (method, cloth) in enumerate(selected.series.items()):
        x, y = place % columns * width, place // columns * (height + room)
        image.paste(Image.fromarray(pictures[place]), (x, y + room))
        texts = {y + room / 2: selected.labels[method]}
        if frame >= cloth.frames:
            texts[y + room + height - letter] = f"ended at {cloth.times[-1]:.2f} s: {cloth.status}"
        for line, text in texts.items():
            while draw.textlength(text, font) > 0.96 * width and len(text) > 1:
                text = text.rstrip("…")[:-1] + "…"
            draw.text((x + width / 2, line), text, INK, font, anchor="mm")
    draw.text((image.width / 2, image.height - room / 2), f"{time:.2f} s", INK, font, anchor="mm")
    return np.asarray(image)


def write_gif(path: Path, frames: Iterable[np.ndarray], rate: float) -> None:
    """Write a GIF whose hundredths of a second add up to the right time, in shades of the film's colours.

    Browsers show a frame for two hundredths or more: of a higher rate every second or third frame is
    kept.
    """
    from PIL import Image

    step = max(1, math.ceil(round(rate / MOST_RATE, 6)))
    rate /= step
    # Of all frames at once: one picture's own palette has no place for what the others show.
    shades = np.linspace(0.0, 1.3, 126)[:, None]
    colours = [np.minimum(255.0 * shades * colour, 255.0) for colour in (CLOTH_COLOUR, BODY_COLOUR)]
    table = np.concatenate([*colours, [PAPER, INK]]).round().astype(np.uint8)
    palette = Image.new("P", (1, 1))
    palette.putpalette(table.tobytes())
    drawn = [
        Image.fromarray(x).quantize(palette=palette, dither=Image.Dither.NONE)
        for x in islice(frames, 0, None, step)
    ]
    ends = [10 * round(100.0 * (k + 1) / rate) for k in range(len(drawn))]
    durations = [end - start for start, end in zip([0, *ends], ends)]
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=durations, loop=0)


def write_point_caches(path: Path, selected: SceneRollOuts) -> None:
    """Write the vertices of each method, and of the body, as NAME_METHOD.pc2 with an .obj beside it."""
    from reference_sim.trajectory import write_point_cache

    for name, mesh in ({**selected.series, **({"body": selected.body} if selected.body else {})}).items():
        write_point_cache(path.with_stem(f"{path.stem}_{name.replace('/', '-')}"), mesh)


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
    parser.add_argument("-o", "--out", required=True, metavar="FILE", help="x.gif or x.pc2")
    options = parser.parse_args(arguments)
    path, methods = Path(options.out), [name.strip() for name in options.methods.split(",")]
    if not 0.01 <= options.speed <= 10.0 or not 64 <= options.width <= 2000:
        raise ValueError("--speed is 0.01 to 10, --width 64 to 2000")
    if path.suffix not in (".gif", ".pc2"):
        raise ValueError(f"{path}: a film ends in .gif, point caches in .pc2")
    demand_writable_folder(path.parent)
    selected = select_roll_outs(RunFolder(options.run_dir), options.scene, methods, options.seed)
    if path.suffix == ".pc2":
        write_point_caches(path, selected)
    else:
        dt = selected.longest.dt
        rate = options.speed / dt if dt > 0.0 else 1.0
        with replacing(path) as temporary:
            write_gif(temporary, draw_frames(selected, options.width, options.azimuth), rate)
    print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
