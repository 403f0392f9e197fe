"""Sheets of pictures of garments: methods side by side, coloured by what a vertex has, and failures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.plotting import PAGE_WIDTH, Picture, file_name, new_figure, save, wrapped
from reports.pictures.render import BODY_COLOUR, CLOTH_COLOUR, LIFT, Surface, camera_for, views
from reports.run.rows import STEP, Run
from reports.tables.numbers import number

if TYPE_CHECKING:
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

    from reference_sim.trajectory.trajectory import Trajectory

DOTS = 200  # of a picture in an inch
FRONT, BACK = -25.0, 155.0  # turns of the camera [degrees]
BAR, NAME, SIDE = 0.62, 0.24, 0.2  # inches for a scale, a line of words and one at the side
FULL = 97.0  # percentile of the values of the worst method: it has the darkest colour
STRIP = 6  # frames side by side
NOTHING = 1e-6  # of a scale's unit: what is less everywhere is not shown
INERTIA = "energy/inertia"


@dataclass(frozen=True)
class Filmed:
    """Roll-outs of one scene: method -> cloth, the body, and areas (F,) [m^2] of faces at rest."""

    scene: str
    series: Mapping[str, Trajectory]
    body: Trajectory | None = None
    rest: np.ndarray | None = None

    def chosen_frame(self, methods: Sequence[str], reference: str) -> tuple[int, str]:
        """One that these methods have, and why: where the simulation's inertia is largest, else the middle.

        The first fifth is left out, in which a method may still be settling; so is a frame whose step nobody
        has judged, where others were.
        """
        frames = min(self.series[method].frames for method in methods)
        inertia = self.series[reference].frame_fields.get(INERTIA) if reference in self.series else None
        if inertia is None:
            return frames // 2, "the middle"
        lively = np.nan_to_num(inertia[:frames])
        judged = [self.series[m].frame_fields[STEP][:frames] for m in methods if self.has_steps([m])]
        for steps in judged:
            lively = np.where(np.isfinite(steps).all(axis=1), lively, -1.0)
        first = frames // 5
        return first + int(np.argmax(lively[first:])), "where the simulation's inertia term is largest"

    def has_steps(self, methods: Sequence[str]) -> bool:
        """Whether the one-step error of every vertex is known of all of these."""
        return all(STEP in self.series[method].frame_fields for method in methods)


@dataclass(frozen=True)
class Scale:
    """What cloths are coloured by: title with its unit, and method -> (V,) values from 0 up."""

    title: str
    values: Mapping[str, np.ndarray]

    @property
    def top(self) -> float:
        return max(float(np.percentile(np.nan_to_num(own), FULL)) for own in self.values.values())

    def colours(self, method: str) -> np.ndarray:
        """(V,3), pale to dark in grey too."""
        share = np.nan_to_num(self.values[method]) / max(self.top, np.finfo(float).tiny)
        return _colours()(np.clip(share, 0.0, 1.0))[:, :3]


def _colours() -> Colormap:
    from matplotlib import colormaps

    return colormaps["YlOrRd"]


def scales(filmed: Filmed, methods: Sequence[str], frame: int, reference: str) -> dict[str, Scale]:
    """By name, of what is known of all of these methods at that frame."""
    from reports.page.vertex_values import area_change, depth, distance, mean_curvature, skin_of

    cloths = {method: filmed.series[method] for method in methods}
    at = {m: cloth.positions[frame] for m, cloth in cloths.items()}
    found = {}
    if filmed.has_steps(methods):
        found["step"] = Scale(
            "one-step error [mm]", {m: c.frame_fields[STEP][frame] for m, c in cloths.items()}
        )
    if reference in at and len({x.shape for x in at.values()}) == 1:
        away = {m: distance(x[None], at[reference][None])[0] for m, x in at.items()}
        found["distance"] = Scale("from the simulation [mm]", away)
    if filmed.rest is not None and all(len(c.faces) == len(filmed.rest) for c in cloths.values()):
        strain = {m: np.abs(area_change(x[None], cloths[m].faces, filmed.rest)[0]) for m, x in at.items()}
        found["strain"] = Scale("change of area [%]", strain)
    bent = {m: mean_curvature(x[None], cloths[m].faces)[0] for m, x in at.items()}
    found["curvature"] = Scale("mean curvature [1/m]", bent)
    body = filmed.body
    skin = skin_of(body.positions[frame], body.faces) if body and frame < body.frames else None
    if skin:
        deep = {m: depth(x, skin, 0) for m, x in at.items()}
        found["depth"] = Scale("below the skin [mm]", deep)
    return {name: scale for name, scale in found.items() if scale.top > NOTHING}


def sheet(
    rows: Sequence[Sequence[np.ndarray]],
    tile: tuple[float, float],
    heads: Sequence[str],
    *,
    below: Sequence[Sequence[str]] = (),
    beside: Sequence[str] = (),
    bar: Scale | None = None,
) -> Figure:
    """Pictures in rows, each of `tile` [inches]; words over the columns, below each and beside each row."""
    wide, high = tile
    under = NAME * 0.75 * _lines(words for row in below for words in row)
    top, left = NAME * 0.75 * _lines(heads), SIDE * _lines(beside)
    columns = max(len(row) for row in rows)
    width = left + wide * columns + (BAR if bar else 0.0)
    height = top + len(rows) * (high + under)
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    for line, row in enumerate(rows):
        floor = height - top - (line + 1) * (high + under) + under
        if beside:
            figure.text(0.5 * left / width, (floor + high / 2) / height, beside[line], rotation=90,
                ha="center", va="center", fontsize=8)  # fmt: skip
        for place, image in enumerate(row):
            start = left + place * wide
            axes = figure.add_axes((start / width, floor / height, wide / width, high / height))
            axes.imshow(image, interpolation="none")
            axes.set_axis_off()
            middle = (start + wide / 2) / width
            if line == 0 and heads:
                figure.text(middle, 1.0 - 0.02 / height, heads[place], ha="center", va="top", fontsize=8.5)
            if below:
                figure.text(
                    middle, (floor - 0.02) / height, below[line][place], ha="center", va="top", fontsize=8
                )
    if bar:
        _bar(figure, bar, (width - BAR + 0.12) / width, height)
    return figure


def _lines(texts: Iterable[str]) -> int:
    """Of the one that has most."""
    return max((text.count("\n") + 1 for text in texts), default=0)


def _bar(figure: Figure, scale: Scale, left: float, height: float) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    place = figure.add_axes((left, 0.12, 0.018, 0.74))
    bar = figure.colorbar(ScalarMappable(Normalize(0.0, scale.top), _colours()), cax=place)
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.set_label(scale.title, fontsize=8)
    place.locator_params(axis="y", nbins=4)
    place.tick_params(labelsize=7.5, length=2)


def shots(
    filmed: Filmed, methods: Sequence[str], frame: int, turn: float, tile: tuple[float, float],
    scale: Scale | None = None,
) -> list[np.ndarray]:  # fmt: skip
    """A picture of each method at that frame from the same place, plain or coloured."""
    cloths = [
        Surface(
            filmed.series[m].positions[frame], filmed.series[m].faces,
            scale.colours(m) if scale else CLOTH_COLOUR, LIFT,
        )
        for m in methods
    ]  # fmt: skip
    body = filmed.body
    skin = Surface(body.positions[frame], body.faces, BODY_COLOUR) if body and frame < body.frames else None
    # What has gone to pieces would make all others small: the camera is the first one's.
    camera = camera_for([cloths[0].positions], turn, tile[1] / tile[0])
    return views(skin, cloths, camera, round(DOTS * tile[0]), round(DOTS * tile[1]))


def _heads(run: Run, methods: Sequence[str], wide: float) -> list[str]:
    return [wrapped(run.label(method), round(15 * wide)) for method in methods]


def lead_row(
    folder: Path, run: Run, filmed: Filmed, methods: Sequence[str], said: Mapping[str, str]
) -> Picture:
    """The methods of page one, coloured by one-step error where it is known; words below each."""
    frame, _ = filmed.chosen_frame(methods, run.reference)
    known = scales(filmed, methods, frame, run.reference)
    name, scale = next(iter(known.items()), ("", None))
    wide = (PAGE_WIDTH - BAR) / max(len(methods), 3)
    tile = (wide, 1.55)
    figure = sheet(
        [shots(filmed, methods, frame, FRONT, tile, scale)], tile, _heads(run, methods, wide),
        below=[[said.get(method, "") for method in methods]], bar=scale,
    )  # fmt: skip
    what = {
        "step": "distance from the minimum of the frame's own time step; below: mean over frames",
        "distance": "distance from the simulation's vertex; below: mean over frames",
    }.get(name, scale.title if scale else "none")
    time = float(filmed.series[methods[0]].times[frame])
    caption = f"{filmed.scene} at {number(time)} s. Colour: {what}."
    return save(figure, folder, "lead", caption=caption, kind="lead row", vector=False)


def side_by_side(folder: Path, run: Run, filmed: Filmed, methods: Sequence[str]) -> Picture:
    """All methods at one frame, from the front and from behind."""
    frame, why = filmed.chosen_frame(methods, run.reference)
    wide = min((PAGE_WIDTH - SIDE) / len(methods), 1.5)
    tile = (wide, 1.12 * wide)
    rows = [shots(filmed, methods, frame, turn, tile) for turn in (FRONT, BACK)]
    figure = sheet(rows, tile, _heads(run, methods, wide), beside=("front", "back"))
    time = float(filmed.series[methods[0]].times[frame])
    caption = f"{filmed.scene}: frame {frame} (t = {number(time)} s), {why}."
    for why, left in _not_shown(filmed, methods).items():
        caption += f" Not shown, {why}: {', '.join(map(run.label, run.ordered(left)))}." if left else ""
    return save(
        figure, folder, f"frames_{file_name(filmed.scene)}", caption=caption, kind="frames", vector=False
    )


def _not_shown(filmed: Filmed, methods: Sequence[str]) -> dict[str, list[str]]:
    """Why -> the roll-outs that are not among these methods."""
    frames = {method: cloth.frames for method, cloth in filmed.series.items() if method not in methods}
    last = max(filmed.series[method].frames for method in methods)
    return {
        "for they ended before it": [method for method, own in frames.items() if own < last],
        "for want of room": [method for method, own in frames.items() if own >= last],
    }


def strip(folder: Path, run: Run, filmed: Filmed, methods: Sequence[str], spare: bool = False) -> Picture:
    """Frames of a motion, evenly spread, a row for each method; spare: to fill a page."""
    frames = min(filmed.series[method].frames for method in methods)
    chosen = np.unique(np.linspace(frames // 5, frames - 1, STRIP).astype(int))
    beside = [wrapped(run.label(method), 14) for method in methods]
    wide = (PAGE_WIDTH - SIDE * _lines(beside)) / STRIP
    tile = (wide, 1.05 * wide)
    seen = [shots(filmed, methods, int(frame), FRONT, tile) for frame in chosen]
    times = filmed.series[methods[0]].times
    heads = [f"{number(float(times[frame]))} s" for frame in chosen]
    figure = sheet(list(zip(*seen)), tile, heads, beside=beside)
    caption = f"{filmed.scene}: the same frames of each method."
    return save(
        figure,
        folder,
        f"strip_{file_name(filmed.scene)}",
        caption=caption,
        kind="spare" if spare else "strip",
        vector=False,
    )


def maps(folder: Path, run: Run, filmed: Filmed, methods: Sequence[str]) -> list[Picture]:
    """A row of pictures for each thing that cloths can be coloured by, but that of page one."""
    frame, _ = filmed.chosen_frame(methods, run.reference)
    pictures: list[Picture] = []
    known = scales(filmed, methods, frame, run.reference)
    for name in list(known)[:1]:
        known.pop(name)
    wide = min((PAGE_WIDTH - BAR) / len(methods), 1.52)
    tile = (wide, 0.86 * wide)
    for turn, (name, scale) in zip((FRONT, BACK, FRONT, BACK), known.items()):
        heads = _heads(run, methods, wide) if not pictures else ()
        figure = sheet([shots(filmed, methods, frame, turn, tile, scale)], tile, heads, bar=scale)
        side = "front" if turn == FRONT else "back"
        caption = f"{filmed.scene}, the frame of page one, {side}: {scale.title}."
        pictures.append(save(figure, folder, f"map_{name}", caption=caption, kind="colours", vector=False))
    return pictures


@dataclass(frozen=True)
class Failure:
    """A roll-out that went far wrong: its method, the frame to look at, and words for below it."""

    filmed: Filmed
    method: str
    frame: int
    words: str


def gallery(folder: Path, run: Run, failures: Sequence[Failure]) -> list[Picture]:
    """The worst frames side by side."""
    if not failures:
        return []
    wide = PAGE_WIDTH / max(len(failures), 4)
    tile = (wide, 1.1 * wide)
    images = [shots(f.filmed, [f.method], f.frame, FRONT, tile)[0] for f in failures]
    heads = [
        wrapped(f"{run.label(f.method)}: {f.filmed.scene.rpartition('/')[2]}", round(14 * wide))
        for f in failures
    ]
    figure = sheet([images], tile, heads, below=[[f.words for f in failures]])
    caption = "The worst of trained networks by strain over the simulation's: each at its worst frame."
    return [save(figure, folder, "failures", caption=caption, kind="failures", vector=False)]
