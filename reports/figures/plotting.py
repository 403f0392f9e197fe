"""Plotting in one look: the style of each method, figures and their files.

Styles of methods: the same colour and marker in every figure, from family, role and base.

Colours are those of Okabe and Ito (2008), told apart under every common colour-vision deficiency;
the marker repeats what the colour says, for print in grey.
"""

from __future__ import annotations

import math
import textwrap
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reference_sim.files.atomic_files import replacing
from reports.finished_run import ReportedMethod, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis
    from matplotlib.figure import Figure as Canvas
    from matplotlib.legend import Legend

Line = str | tuple[float, tuple[float, ...]]  # matplotlib's: a name, or an offset and the dashes [points]


@dataclass(frozen=True)
class Style:
    """Style of a method or family: label for people, colour, matplotlib marker and line."""

    label: str
    colour: str
    marker: str
    line: Line = "-"


# By family; a method that shares its family with none is one by itself. Only families that are drawn as
# one line have a label here: any other label is the method's own.
KNOWN = {
    "simulation": Style("", "#000000", "*"),
    "simulation-perturbed": Style("", "#444444", "x", "--"),
    "skinning": Style("", "#8C8C8C", "D", "--"),
    "pbns": Style("", "#009E73", "^", "-."),
    "pbns-springs": Style("", "#117733", "^", ":"),
    "pbns-paper": Style("", "#00725A", "^", "--"),
    "tailornet": Style("", "#661100", "H", ":"),
    "santesteban2019": Style("", "#AA4499", "d", (0.0, (1.0, 1.0))),
    "handles-80": Style("", "#CC6677", "p", "--"),
    "supervised": Style("", "#E69F00", "s", (0.0, (6.0, 1.5))),
    "snug": Style("", "#0072B2", "o"),
    "snug-paper": Style("", "#94A000", "o", "-."),
    "snug-shapes": Style("", "#EE3377", "o", ":"),
    "newton": Style("Newton", "#D55E00", "P"),
    "lbfgs": Style("L-BFGS", "#CC79A7", "X"),
    "fast-lbfgs": Style("Fast L-BFGS", "#BB5566", "X", "--"),
    "gradient-descent": Style("Gradient descent", "#7A5C00", "p"),
    "vbd": Style("Vertex block descent", "#44AA99", ">"),
    "xpbd": Style("XPBD", "#332288", "<"),
    "simulation-tolerance": Style("Simulation to a tolerance", "#555555", "*"),
    "simulation-dt": Style("Simulation with smaller steps", "#882255", "*"),
}
_SPARE = ("#999933", "#661100", "#AA4499", "#117733", "#88CCEE", "#DDCC77")
_SPARE_MARKERS = ("h", "8", "d", "v", "p")


def family_style(run: Run, method: ReportedMethod) -> Style:
    """Return the style of a method's family; an unknown one has a spare colour that depends on its name.

    A method that starts from another has the look of that one, whether it ran or not, with a marker of
    its own where it is a solver; an ablation has the marker of its base alone.
    """
    label = method.label if method.level is None else method.label.partition(",")[0]
    if preset := KNOWN.get(method.family):
        return replace(preset, label=preset.label or label)
    number = zlib.crc32(method.family.encode())
    spare = Style(label, _SPARE[number % len(_SPARE)], _SPARE_MARKERS[number % len(_SPARE_MARKERS)])
    base = run.methods.get(method.base)
    look = family_style(run, base) if base and base is not method else KNOWN.get(method.base)
    if look is None:
        return spare
    if method.role == "ablation":
        return replace(spare, marker=look.marker, line=":")
    if method.role == "warm-started":
        return replace(look, label=label, marker="X", line="-.")
    return replace(look, label=label)


def style(run: Run, method: str) -> Style:
    """Return the style of one method: that of its family with its own label."""
    declared = run.methods[method]
    return replace(family_style(run, declared), label=declared.label)


PAGE_WIDTH = 6.7  # inches of text width on the report's page
PANEL = 1.6  # inches (4.06 cm) that panels are high at least, and at least wide
GRID = "#E3E3E3"
DOTS = 200  # of a picture in an inch
_LOOK: dict[Any, Any] = {
    # Each has what those before it lack; the last draws a box that names the script.
    "font.family": ["STIXGeneral", "DejaVu Sans", "Last Resort High-Efficiency"],
    "text.parse_math": False,  # a name may hold dollars
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "axes.labelcolor": "#222222",
    "text.color": "#222222",
    "lines.linewidth": 1.3,
    "svg.hashsalt": "report",
    "svg.fonttype": "path",
    "figure.dpi": 100,
}


def new_figure(width: float, height: float) -> Canvas:
    """Make an empty figure [inches] in the look of the report, without pyplot and its global state."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    matplotlib.rcParams.update(_LOOK)
    figure = Canvas(figsize=(width, height), layout="constrained")
    figure.get_layout_engine().set(h_pad=0.04, w_pad=0.03)  # type: ignore[union-attr,call-arg]
    FigureCanvasAgg(figure)
    return figure


def new_panels(count: int) -> tuple[Canvas, list[Axes]]:
    """Make a figure as wide as the page with `count` panels in a row; `fit` gives it its height."""
    figure = new_figure(PAGE_WIDTH, 4.0 * PANEL)
    panels = list(figure.subplots(1, count, squeeze=False).flat)
    for axes in panels:
        axes.grid(True, color=GRID, linewidth=0.6)
    return figure, panels


def fit(figure: Canvas, entries: Sequence[Style], *, markers: bool = False) -> None:
    """Draw a legend above the panels, and give the figure the height at which each is PANEL high.

    Call it when all that takes room is drawn; panels stay where they are from then on.
    """
    entries = entries if markers else [replace(look, marker="") for look in entries]
    widest = _legend(figure, entries, 1)
    width = widest.get_window_extent().width
    widest.remove()
    _legend(figure, entries, max(1, int(figure.bbox.width / width)))
    for _ in range(2):  # numbers beside an axis depend on its height
        figure.draw_without_rendering()
        lowest = min(axes.get_window_extent().height for axes in figure.axes) / figure.dpi
        figure.set_figheight(figure.get_figheight() + (PANEL - lowest))
    figure.draw_without_rendering()


def log_axis(axes: Axes, name: str) -> None:
    """Make the x or y axis logarithmic with plain numbers: 0.01, 0.1, 1; and 2, 5 where it is short.

    Call it when the limits are set.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis: XAxis | YAxis = axes.xaxis if name == "x" else axes.yaxis
    axes.set(**{f"{name}scale": "log"})
    low, high = axis.get_view_interval()
    decades = math.log10(high / low)
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 1.7 else (1.0,), numticks=7))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value)))
    axis.set_minor_formatter(NullFormatter())


def power_text(value: float) -> str:
    """Return a number as "0.25" or "2e-7": matplotlib's raised digits are too small to read."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"
    mantissa, _, power = f"{value:.0e}".partition("e")
    return f"{mantissa}e{int(power)}"


def escape(text: str) -> str:
    """Return the text with letters that the typesetter's fonts do not have as "U+88FE"."""
    missing_letters = {c for c in text if c.isalpha() and not c.isascii()} - _letters()
    return text.translate({ord(c): f"U+{ord(c):04X}" for c in missing_letters})


@cache
def _letters() -> frozenset[str]:
    """Return the letters of DejaVu Sans Mono, the typesetter's widest font, which matplotlib has too."""
    from matplotlib.font_manager import findfont, get_font

    return frozenset(map(chr, get_font(findfont("DejaVu Sans Mono")).get_charmap()))


def file_name(text: str) -> str:
    """Return a scene's or method's name as part of a file name, in letters that the report's text keeps."""
    return "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in escape(text))


def _legend(figure: Canvas, entries: Sequence[Style], columns: int) -> Legend:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=look.colour, marker=look.marker, markersize=4.0,
               label=textwrap.fill(look.label, 30), ls=look.line)
        for look in entries
    ]  # fmt: skip
    return figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.4,
    )


@dataclass(frozen=True)
class Drawing:
    """A drawn figure, the name of its files and its caption; a photograph has no vector graphic."""

    canvas: Canvas
    name: str
    caption: str
    vector: bool = True


@dataclass(frozen=True)
class Picture:
    """A figure as it lies on disk: its file for the PDF, caption and share of the page's width."""

    path: Path
    caption: str
    width: float


@dataclass(frozen=True)
class Figure:
    """A figure: its name, with which its files begin, and what draws it where the run has its data."""

    name: str
    draw: Callable[[Run], Drawing | None]


def draw_figures(run: Run, folder: Path, figures: Iterable[Figure]) -> Mapping[str, Picture]:
    """Draw all that the run has data for, in place of older files; return name -> picture."""
    pictures = {}
    for figure in figures:
        for path in [*folder.glob(f"{figure.name}*.png"), *folder.glob(f"{figure.name}*.svg")]:
            path.unlink()
        if drawing := figure.draw(run):
            pictures[figure.name] = save_drawing(folder, drawing)
    return pictures


def save_drawing(folder: Path, drawing: Drawing) -> Picture:
    """Write <name>.png and, unless it is a photograph, <name>.svg, which the PDF takes."""
    from PIL import Image

    canvas, path = drawing.canvas, folder / f"{drawing.name}.png"
    with replacing(path) as temporary:
        canvas.savefig(temporary, dpi=DOTS)
        with Image.open(temporary) as image:  # 256 colours: a third of the bytes, none moves by 5 %
            reduced = image.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE)
        reduced.save(temporary, "PNG", optimize=True, dpi=(DOTS, DOTS))
    if drawing.vector:
        canvas.set_layout_engine("none")  # it has done its work, which is half of the time of a figure
        with replacing(path := path.with_suffix(".svg")) as temporary:
            canvas.savefig(temporary, metadata={"Date": None})
    return Picture(path, drawing.caption, min(1.0, canvas.get_figwidth() / PAGE_WIDTH))
