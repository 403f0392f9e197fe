"""Labels beside what they name, placed where they cover neither each other nor markers and lines."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DISTANCES = (5.0, 9.0, 14.0, 20.0, 28.0, 38.0, 50.0)  # [points] from the spot, in order of preference
NEAR = 10.0  # [points] from which on a thin line leads to the spot
# Directions in order of preference: right, left, above, below, then between them.
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))
# Cost of an area [square pixel] shared with another label, a marker or line, and the outside of the axes.
ON_LABEL, ON_MARK, OUTSIDE = 12.0, 6.0, 12.0
PER_POINT, PER_RANK = 0.7, 0.4  # of a point of distance and of a less preferred direction [pixel of height]
MOST_COST = 1.5  # of a place that counts as free, in squares of the label's height
SKIPPED = 0.3  # share of a leading line at its spot, which lies in a marker


@dataclass(frozen=True)
class Label:
    """A text, the spot that it names in data coordinates, and its colour."""

    text: str
    spot: tuple[float, float]
    colour: str


def place_labels(
    axes: Axes, labels: Sequence[Label], marks: np.ndarray, size: float, known: Collection[str] = ()
) -> None:
    """Write labels beside their spots, the first ones first.

    Call it when limits, scales and all other content of the figure are set and `fit` has placed it.

    Args:
        axes: of the spots.
        labels: what to write.
        marks: (N,4) boxes of markers and lines that labels should not cover, see `boxes_of`.
        size: of the letters [points].
        known: texts that are left out where they have no free place close to their spot.
    """
    from matplotlib.patheffects import withStroke

    pixels = _figure_of(axes).dpi / 72.0
    extent = axes.get_window_extent()
    frame = np.array([[extent.x0, extent.y0, extent.x1, extent.y1]])
    taken = np.empty((0, 4))
    for label in labels:
        spot = axes.transData.transform(label.spot)
        text = axes.annotate(
            label.text, label.spot, textcoords="offset points", xytext=(0, 0), fontsize=size,
            color=label.colour, zorder=5, annotation_clip=False, va="bottom",
            path_effects=[withStroke(linewidth=1.5, foreground="white")],
        )  # fmt: skip
        text.set_in_layout(False)
        letters = text.get_window_extent()
        places = _places(spot, letters.width, letters.height, pixels)
        costs = [cost * letters.height + _cost(box, lead, frame, taken, marks) for box, lead, cost in places]
        place = int(np.argmin(costs))
        box, lead, _ = places[place]
        free = costs[place] < MOST_COST * letters.height**2 and not len(lead)
        if label.text in known and not free:
            text.remove()
            continue
        text.set_position(tuple((box[:2] - spot) / pixels))
        taken = np.vstack([taken, box[None], lead])
        if len(lead):
            end = np.clip(spot, box[:2], box[2:])
            x, y = axes.transData.inverted().transform(end)
            axes.plot([label.spot[0], x], [label.spot[1], y], color=label.colour, linewidth=0.5, zorder=2.5)


def _places(
    spot: np.ndarray, width: float, height: float, pixels: float
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return places of a label around its spot [pixel].

    Returns:
        For each place the box (4,) of the label, boxes (N,4) along the line that leads to it, none where it
        is close, and what its distance and direction cost.
    """
    places = []
    for rank, (across, up) in enumerate(DIRECTIONS):
        for distance in DISTANCES:
            step = distance * pixels / math.hypot(across, up)
            left = spot[0] + across * step + (-width, -width / 2, 0.0)[across + 1]
            bottom = spot[1] + up * step + (-height, -height / 2, 0.0)[up + 1]
            box = np.array([left, bottom, left + width, bottom + height])
            lead = np.empty((0, 4))
            if distance > NEAR:
                end = np.clip(spot, box[:2], box[2:])
                lead = _along(np.array([spot + (end - spot) * SKIPPED, end]), pixels)
            places.append((box, lead, PER_POINT * distance + PER_RANK * rank))
    return places


def _cost(
    box: np.ndarray, lead: np.ndarray, frame: np.ndarray, taken: np.ndarray, marks: np.ndarray
) -> float:
    """Return what a place of a label costs: for all that it covers and that its leading line crosses."""
    width, height = box[2:] - box[:2]
    covered = ON_LABEL * _shared(box, taken) + ON_MARK * _shared(box, marks)
    crossed = sum(ON_LABEL * _shared(piece, taken) + ON_MARK * _shared(piece, marks) for piece in lead)
    return covered + crossed + OUTSIDE * (width * height - _shared(box, frame))


def boxes_of(axes: Axes, points: np.ndarray, size: float) -> np.ndarray:
    """Return boxes (N,4) [pixel] of markers of that size [points] at points (N,2) in data coordinates."""
    return _around(axes.transData.transform(points), size * _figure_of(axes).dpi / 72.0)


def boxes_along(axes: Axes, points: np.ndarray, size: float) -> np.ndarray:
    """Return boxes (N,4) [pixel] of a line of that width [points] through points (N,2), as `boxes_of`."""
    return _along(axes.transData.transform(points), size * _figure_of(axes).dpi / 72.0)


def _along(corners: np.ndarray, width: float) -> np.ndarray:
    """Return boxes (N,4) of a line of that width through corners (M,2), all in pixels, gaps between them."""
    pieces = [
        start + (end - start) * np.arange(0.0, 1.0, 2.0 * width / max(math.dist(start, end), width))[:, None]
        for start, end in itertools.pairwise(corners)
    ]
    return _around(np.vstack(pieces), width)


def _around(centres: np.ndarray, size: float) -> np.ndarray:
    return np.hstack([centres - size / 2.0, centres + size / 2.0])


def _shared(box: np.ndarray, others: np.ndarray) -> float:
    """Return the area [square pixel] that a box shares with others (N,4), summed."""
    wide = np.minimum(box[2], others[:, 2]) - np.maximum(box[0], others[:, 0])
    high = np.minimum(box[3], others[:, 3]) - np.maximum(box[1], others[:, 1])
    return float(np.sum(np.clip(wide, 0.0, None) * np.clip(high, 0.0, None)))


def _figure_of(axes: Axes) -> Figure:
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure
