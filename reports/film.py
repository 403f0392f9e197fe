"""python -m reports.film RUN: a film of methods side by side in a scene, from one camera."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import demand_writable_folder, replacing
from reports.pictures import AZIMUTH, BODY_COLOUR, CLOTH_COLOUR, INK, PAPER, SceneRollOuts, draw_frames

if TYPE_CHECKING:
    from reports.finished_run import Run

EXAMPLES = """examples:
  python -m reports.film RUN --scene tshirt/kick --methods simulation,snug -o kick.gif
  python -m reports.film RUN --scene tshirt/kick --methods simulation,mine -o kick.png
  python -m reports.film RUN --scene tshirt/kick --methods snug -o kick.pc2

A .png is the frame in which the first method's inertia term is largest. A .pc2 becomes kick_snug.pc2 and
kick_body.pc2, all vertices, with an .obj each: metres, y up, for Blender's Mesh Cache modifier.

The camera follows the garment; a roll-out that ended early keeps its last frame.
exit status: 0 written; 2 the run has no such roll-out: one line says why."""
SHADES = 40  # of either colour: three seconds of four views are below 3 MB
MOST_RATE = 16.0  # frames a second of a GIF


def select_roll_outs(
    folder: RunFolder, scene: str, methods: Sequence[str], seed: int | None = None
) -> SceneRollOuts:
    """Read roll-outs of a scene; of methods that have seeds this one, or the first that the run has.

    Raises:
        ResultsError: for a roll-out that the run did not keep; the message names those of its scenes.
    """
    from reports.finished_run import read_run

    run = read_run(folder)
    rows = run.frame[(run.frame["case"] == "") & (run.frame["scene"] == scene)]
    cloths = {}
    for method in methods:
        of_method = rows[rows["method"] == method]
        shown_seed = of_method["seed"].min() if seed is None or not of_method["seeded"].any() else seed
        cloth = run.roll_outs.cloth(scene, method, int(shown_seed)) if len(of_method) else None
        if cloth is None or not cloth.finite().frames:
            reason = "; ".join(run.problems) or _list_stored(folder, run, scene)
            cell = f"'{method}' in {scene}"
            cell += f", seed {shown_seed}" if len(of_method) else ""
            raise ResultsError(f"{folder.path}: no roll-out of {cell}: {reason}")
        cloths[method] = cloth.finite()
    labels = {name: run.label(name) for name in cloths}
    return SceneRollOuts(scene, cloths, run.roll_outs.body(scene), labels)


def _list_stored(folder: RunFolder, run: Run, scene: str) -> str:
    """Return the methods of the roll-outs in a scene, or the scenes that have any."""
    cells = run.cells()[["scene", "method", "seed"]].drop_duplicates().itertuples(index=False, name=None)
    stored = [cell for cell in cells if folder.trajectory_path(*cell).is_file()]
    methods = [method for name, method, _ in stored if name == scene]
    names = dict.fromkeys(methods or [name for name, *_ in stored])
    if not names:
        return "this run has kept no roll-outs, as a published one"
    return f"{'roll-outs there' if methods else 'scenes with roll-outs'} are {', '.join(names)}"


def write_frames(path: Path, frames: Iterable[np.ndarray], rate: float) -> None:
    """Write a PNG of one frame, or a GIF that takes the right time.

    Colours are shades of those of cloth and body. Of a rate above `MOST_RATE` every second, third or
    later frame is kept.
    """
    from PIL import Image

    step = max(1, math.ceil(round(rate / MOST_RATE, 6)))
    rate /= step
    # Of all frames at once: one picture's own palette has no place for what the others show.
    shades = np.linspace(0.0, 1.3, SHADES)[:, None]
    colours = [np.minimum(255.0 * shades * colour, 255.0) for colour in (CLOTH_COLOUR, BODY_COLOUR)]
    table = np.concatenate([*colours, [PAPER, INK]]).round().astype(np.uint8)
    palette = Image.new("P", (1, 1))
    palette.putpalette(table.tobytes())
    drawn = [
        Image.fromarray(x).quantize(palette=palette, dither=Image.Dither.NONE)
        for x in islice(frames, 0, None, step)
    ]
    ends = [10 * round(100.0 * (k + 1) / rate) for k in range(len(drawn))]
    durations = np.diff(ends, prepend=0).tolist()
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=durations, loop=0)


def write_point_caches(path: Path, group: SceneRollOuts) -> list[Path]:
    """Write NAME_METHOD.pc2 and .obj of each method and of the body; return all paths."""
    from reference_sim.trajectory import write_point_cache

    body = {"body": group.body} if group.body else {}
    paths: list[Path] = []
    for name, mesh in {**group.series, **body}.items():
        stem = f"{path.stem}_{name.replace('/', '-')}"
        paths += write_point_cache(path.with_stem(stem), mesh)
    return paths


@command("reports.film")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.film",
        description="A film of methods side by side in a scene of a run.",
        epilog=EXAMPLES,
    )
    parser.add_argument("run_dir", metavar="RUN", help="folder of a run with its trajectories")
    parser.add_argument("--scene", required=True, help="as in results.csv, say tshirt/kick")
    parser.add_argument("--methods", required=True, metavar="NAME,...", help="as in results.csv")
    parser.add_argument("--seed", type=int, help="of trained methods (default: the first)")
    parser.add_argument("--width", type=int, default=240, help="of a view [pixels] (default 240)")
    parser.add_argument("--azimuth", type=float, default=AZIMUTH, metavar="DEGREES",
        help="of the camera, to the body's left (default 25; 180: from behind)")  # fmt: skip
    parser.add_argument("-o", "--out", required=True, metavar="FILE", help="x.gif, x.png or x.pc2")
    options = parser.parse_args(arguments)
    path, methods = Path(options.out), [name.strip() for name in options.methods.split(",")]
    if not 64 <= options.width <= 2000:
        raise ValueError("--width is 64 to 2000")
    if not math.isfinite(options.azimuth):
        raise ValueError("--azimuth is a finite number")
    if path.suffix not in (".gif", ".png", ".pc2"):
        raise ValueError(f"{path}: a film ends in .gif, a picture in .png, point caches in .pc2")
    demand_writable_folder(path.parent)
    group = select_roll_outs(RunFolder(options.run_dir), options.scene, methods, options.seed)
    one_frame = [group.lively_frame()[0]] if path.suffix == ".png" else None
    images = draw_frames(group, options.width, options.azimuth, one_frame)
    if path.suffix == ".pc2":
        print(*write_point_caches(path, group), sep="\n")
        return 0
    dt = group.longest.dt
    with replacing(path) as temporary:
        write_frames(temporary, images, 1.0 / dt if dt > 0.0 else 1.0)
    print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
