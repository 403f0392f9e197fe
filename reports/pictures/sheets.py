"""Sheets: renderings of garments in rows, with names, texts and a scale of colours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.chosen_roll_outs import SceneRollOuts
from reports.figures.plotting import DOTS, new_figure, wrapped
from reports.pictures.colour_scales import Scale, colour_map
from reports.pictures.render import BODY_COLOUR, CLOTH_COLOUR, LIFT, Surface, camera_for, views
from reports.run.finished_run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRONT, BACK = -25.0, 155.0  # turns of the camera [degrees]
BAR, NAME, SIDE = 0.62, 0.24, 0.2  # inches for a scale, a line of text and one at the side


def sheet(
    rows: Sequence[Sequence[np.ndarray]],
    tile: tuple[float, float],
    heads: Sequence[str],
    *,
    below: Sequence[Sequence[str]] = (),
    beside: Sequence[str] = (),
    bar: Scale | None = None,
) -> Figure:
    """Compose pictures in rows, each of `tile` [inches], with texts over columns, below and beside rows."""
    wide, high = tile
    under = NAME * 0.75 * count_lines(text for row in below for text in row)
    top, left = NAME * 0.75 * count_lines(heads), SIDE * count_lines(beside)
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


def count_lines(texts: Iterable[str]) -> int:
    """Return the largest number of lines among the texts."""
    return max((text.count("\n") + 1 for text in texts), default=0)


def _bar(figure: Figure, scale: Scale, left: float, height: float) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    place = figure.add_axes((left, 0.12, 0.018, 0.74))
    bar = figure.colorbar(ScalarMappable(Normalize(0.0, scale.top), colour_map()), cax=place)
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.set_label(scale.title, fontsize=8)
    place.locator_params(axis="y", nbins=4)
    place.tick_params(labelsize=7.5, length=2)


def shots(
    roll_outs: SceneRollOuts, methods: Sequence[str], frame: int, turn: float, tile: tuple[float, float],
    scale: Scale | None = None,
) -> list[np.ndarray]:  # fmt: skip
    """Render each method at that frame from the same place, plain or coloured."""
    cloths = [
        Surface(
            roll_outs.series[m].positions[frame], roll_outs.series[m].faces,
            scale.colours(m) if scale else CLOTH_COLOUR, LIFT,
        )
        for m in methods
    ]  # fmt: skip
    body = roll_outs.body
    skin = Surface(body.positions[frame], body.faces, BODY_COLOUR) if body and frame < body.frames else None
    # A torn cloth would make all others small: the camera is the first one's.
    camera = camera_for([cloths[0].positions], turn, tile[1] / tile[0])
    return views(skin, cloths, camera, round(DOTS * tile[0]), round(DOTS * tile[1]))


def heads_of(run: Run, methods: Sequence[str], wide: float) -> list[str]:
    """Return the labels of the methods, broken into lines for tiles so wide [inches]."""
    return [wrapped(run.label(method), round(15 * wide)) for method in methods]
