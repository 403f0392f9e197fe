"""Pictures of garments in a report: methods side by side at one frame, and the worst failures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from reference_sim.trajectory import Trajectory
from reports.figures.figure import Drawing
from reports.figures.plotting import DOTS, PAGE_WIDTH, file_name, leading, new_figure, wrapped
from reports.finished_run import Run, shown_seeds
from reports.rendering import BODY_COLOUR, CLOTH_COLOUR, LIFT, Surface, camera_for, views
from reports.statistics.outcomes import overstretched
from reports.tables.table import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INERTIA, STRAIN = "energy/inertia", "energy/strain"
MOST_SIDE_BY_SIDE = 6  # methods side by side
FRONT = -25.0  # turn of the camera [degrees]
LINE = 0.18  # inches for a line of text
MOST_FAILURES, OF_ONE = 4, 2  # failures that are shown, and how many of them by one method


@dataclass(frozen=True)
class SceneRollOuts:
    """Roll-outs of one scene: method -> cloth, and the body."""

    scene: str
    series: Mapping[str, Trajectory]
    body: Trajectory | None = None

    def chosen_frame(self, methods: Sequence[str], reference: str) -> tuple[int, str]:
        """Choose a frame that these methods have, and say why.

        It is where the reference's inertia is largest, else the middle. The first fifth is left out, in which
        a method may still be settling.
        """
        frames = min(self.series[method].frames for method in methods)
        inertia = self.series[reference].frame_fields.get(INERTIA) if reference in self.series else None
        if inertia is None:
            return frames // 2, "the middle"
        first = frames // 5
        lively = np.nan_to_num(inertia[first:frames])
        return first + int(np.argmax(lively)), "where the simulation's inertia term is largest"


def read_scene(run: Run, rows: pd.DataFrame, methods: Iterable[str]) -> SceneRollOuts:
    """Read the first good seed of each method, or else its first, in the one scene of these rows."""
    scene = str(rows["scene"].iloc[0])
    seeds = shown_seeds(rows).loc[scene]
    cloths = {method: run.roll_outs.cloth(scene, method, int(seeds[method])) for method in methods}
    series = {method: cloth for method, cloth in cloths.items() if cloth is not None}
    return SceneRollOuts(scene, series, run.roll_outs.body(scene) if series else None)


def side_by_side(run: Run) -> Iterator[Drawing]:
    """Draw methods that came to the end of the first whole motion that kept roll-outs, at one frame."""
    rows = run.garment_rows[run.garment_rows["metric"] == "energy/total"]
    for scene in [scene for scenes in run.garments(rows).values() for scene in scenes]:
        of_scene = rows[rows["scene"] == scene]
        roll_outs = read_scene(run, of_scene, leading(run, of_scene["method"]))
        if roll_outs.series:
            most = max(cloth.frames for cloth in roll_outs.series.values())
            whole = [method for method, cloth in roll_outs.series.items() if cloth.frames == most]
            yield draw_side_by_side(run, roll_outs, run.ordered(whole)[:MOST_SIDE_BY_SIDE])
            return


def draw_side_by_side(run: Run, roll_outs: SceneRollOuts, methods: Sequence[str]) -> Drawing:
    """Draw these methods; the caption names the others."""
    frame, why = roll_outs.chosen_frame(methods, run.reference)
    wide = min(PAGE_WIDTH / len(methods), 1.5)
    tile = (wide, 1.12 * wide)
    heads = [wrapped(run.label(method), round(15 * wide)) for method in methods]
    figure = sheet(shots(roll_outs, methods, frame, tile), tile, heads)
    time = float(roll_outs.series[methods[0]].times[frame])
    caption = f"{roll_outs.scene}: frame {frame} (t = {number(time)} s), {why}."
    if others := set(roll_outs.series) - set(methods):
        names = ", ".join(map(run.label, run.ordered(others)))
        caption += f" Not shown, for they ended before it or for want of room: {names}."
    return Drawing(figure, f"frames_{file_name(roll_outs.scene)}", caption, vector=False)


@dataclass(frozen=True)
class Failure:
    """A roll-out that went far wrong: its method, the frame to look at, and a text for below it."""

    roll_outs: SceneRollOuts
    method: str
    frame: int
    text: str


def failures(run: Run) -> Iterator[Drawing]:
    """Draw trained networks with most strain over the simulation's, where their roll-outs are on disk."""
    worst = worst_failures(run)
    if not worst:
        return
    wide = PAGE_WIDTH / max(len(worst), 4)
    tile = (wide, 1.1 * wide)
    images = [shots(f.roll_outs, [f.method], f.frame, tile)[0] for f in worst]
    names = [f"{run.label(f.method)}: {f.roll_outs.scene.rpartition('/')[2]}" for f in worst]
    heads = [wrapped(name, round(14 * wide)) for name in names]
    figure = sheet(images, tile, heads, [f.text for f in worst])
    caption = "The worst of trained networks by strain over the simulation's: each at its worst frame."
    yield Drawing(figure, "failures", caption, vector=False)


def worst_failures(run: Run) -> list[Failure]:
    """Return the failures that are shown."""
    failures: list[Failure] = []
    shown: Counter[str] = Counter()
    for method, scene, strain, ratio in overstretched(run):
        if len(failures) == MOST_FAILURES or shown[method] == OF_ONE:
            continue
        roll_outs = read_scene(run, run.frame[run.frame["scene"] == scene], [method])
        if method in roll_outs.series:
            cloth = roll_outs.series[method]
            curve = cloth.frame_fields.get(STRAIN)
            last = cloth.frames - 1
            frame = last if curve is None else int(np.argmax(np.nan_to_num(curve[: cloth.frames])))
            text = f"{number(strain)} J of strain,\n{number(ratio)} × the simulation's"
            failures.append(Failure(roll_outs, method, frame, text))
            shown[method] += 1
    return failures


def sheet(
    images: Sequence[np.ndarray], tile: tuple[float, float], heads: Sequence[str], below: Sequence[str] = ()
) -> Figure:
    """Compose pictures in a row, each of `tile` [inches], with texts over and below them."""
    wide, high = tile
    top, under = (LINE * max((text.count("\n") + 1 for text in texts), default=0) for texts in (heads, below))
    width, height = wide * len(images), top + high + under
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    for place, image in enumerate(images):
        axes = figure.add_axes((place * wide / width, under / height, wide / width, high / height))
        axes.imshow(image, interpolation="none")
        axes.set_axis_off()
        middle = (place + 0.5) * wide / width
        figure.text(middle, 1.0 - 0.02 / height, heads[place], ha="center", va="top", fontsize=8.5)
        if below:
            figure.text(middle, (under - 0.02) / height, below[place], ha="center", va="top", fontsize=8)
    return figure


def shots(
    roll_outs: SceneRollOuts, methods: Sequence[str], frame: int, tile: tuple[float, float]
) -> list[np.ndarray]:
    """Render each method at that frame from the same place."""
    cloths = [roll_outs.series[method] for method in methods]
    surfaces = [Surface(cloth.positions[frame], cloth.faces, CLOTH_COLOUR, LIFT) for cloth in cloths]
    body = roll_outs.body
    skin = Surface(body.positions[frame], body.faces, BODY_COLOUR) if body and frame < body.frames else None
    # A torn cloth would make all others small: the camera is the first one's.
    camera = camera_for([surfaces[0].positions], FRONT, tile[1] / tile[0])
    return views(skin, surfaces, camera, round(DOTS * tile[0]), round(DOTS * tile[1]))
