"""Figures: the look of methods, curves, and room for many: panels stay large, no text covers another."""

from __future__ import annotations

import itertools

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from reports.blocks import FIGURES
from reports.figures.charts import curves_of
from reports.figures.plotting import PAGE_WIDTH, Drawing, style
from reports.statistics.outcomes import PUBLISHED, read_published
from reports.statistics.pareto import Point
from reports.statistics.relative_excess import add_excess, excess_of
from tests.reports.report_folder import row, run_of

LEAST = 4.0  # [cm] that a panel is wide and high on paper
PRINTED = 17.0 / 2.54 / PAGE_WIDTH  # inches on paper of an inch of a figure as wide as the page
LETTERS = 1.0  # [points] by which boxes of texts may overlap: letters do not fill them


@pytest.fixture(scope="module")
def drawings() -> list[Drawing]:
    """The figures of published runs, one of 26 methods, one with a method whose energy explodes."""
    runs = [read_published(PUBLISHED / name) for name in ("ablations", "paper_text")]
    return [drawing for run in runs for figure in FIGURES if (drawing := figure.draw(run))]


def test_panels_of_many_methods_are_at_least_four_centimetres_wide_and_high(drawings):
    for drawing in drawings:
        FigureCanvasAgg(drawing.canvas).draw()
        scale = 2.54 * min(PRINTED, 17.0 / 2.54 / drawing.canvas.get_figwidth()) / drawing.canvas.dpi
        for axes in drawing.canvas.axes:
            width, height = (scale * length for length in axes.get_window_extent().bounds[2:])
            assert min(width, height) >= LEAST, drawing.name


def test_dots_of_many_methods_are_their_excesses_in_each_motion(drawings):
    (axes,) = next(d.canvas for d in drawings if d.name == "excess_by_motion").axes
    row = [tick.get_text() for tick in axes.get_yticklabels()].index("SNUG")
    run = read_published(PUBLISHED / "ablations")
    excess = excess_of(run, add_excess(run, run.garment_rows), "snug")
    assert sorted(axes.lines[2 * row].get_xdata()) == pytest.approx(sorted(excess.by_motion.values()))
    assert len(axes.get_yticks()) == 15


def test_no_text_covers_another_or_a_panel_and_all_are_inside_the_figure(drawings):
    for drawing in drawings:
        canvas = drawing.canvas
        FigureCanvasAgg(canvas).draw()
        beside, written = texts(canvas)
        legends = [("legend", inner(legend)) for legend in canvas.legends]
        panels = [axes.get_window_extent() for axes in canvas.axes]
        outer = [(text.get_text(), inner(text)) for text in beside] + legends
        assert not [name for name, box in outer if any(map(box.fully_overlaps, panels))], drawing.name
        boxes = [*outer, *((text.get_text(), inner(text)) for text in written)]
        pairs = itertools.combinations(boxes, 2)
        covered = [(one[0], other[0]) for one, other in pairs if one[1].fully_overlaps(other[1])]
        assert not covered, drawing.name
        left, low, right, high = canvas.bbox.extents
        cut = [n for n, box in boxes if box.x0 < left or box.y0 < low or box.x1 > right or box.y1 > high]
        assert not cut, drawing.name


def inner(drawn: Text | Legend) -> Bbox:
    """Box of its letters [pixel]."""
    return drawn.get_window_extent().padded(-LETTERS * drawn.get_figure().dpi / 72.0)


def texts(canvas) -> tuple[list[Text], list[Text]]:
    """Texts that are seen: around panels, and in them."""
    around = list(canvas.texts)
    for axes in canvas.axes:
        around.append(axes.title)
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = (*axis.get_major_ticks(), *axis.get_minor_ticks())
            around += [axis.label, *(t.label1 for t in ticks if low <= t.get_loc() <= high)]
    written = [text for axes in canvas.axes for text in axes.texts]
    return tuple(
        [t for t in some if t.get_visible() and t.get_text().strip()] for some in (around, written)
    )


def test_methods_keep_their_order_and_their_look():
    names = ["zebra", "newton-8", "snug", "newton-2", "simulation", "newton-4", "skinning"]
    run = run_of([row(method=name) for name in names])
    labels = ["simulation", "skinning", "snug", "zebra", "newton-2", "newton-4", "newton-8"]
    assert run.order(names) == labels
    assert style(run, "newton-2").label == "Newton, 2 iterations"
    assert style(run, "newton-2").colour == style(run, "newton-4").colour


# method: run time, error
POINTS = {
    "snug": (0.2, 0.02), "skinning": (0.1, 0.6), "lbfgs-5": (8.0, 0.016), "lbfgs-20": (13.0, 0.0018),
    "newton-1": (10.0, 0.26), "newton-4": (24.0, 0.0008), "snug+lbfgs-1": (7.0, 0.015),
    "snug+lbfgs-4": (7.5, 0.014), "simulation-perturbed-1e-4": (40.0, 1e-9),
}  # fmt: skip


def curves(*methods: str):
    run = run_of([row(method=name) for name in methods])
    return curves_of(run, [Point(name, *POINTS[name]) for name in methods])


def test_solvers_stopped_early_are_one_curve_and_variants_of_the_reference_stand_alone_or_not_at_all():
    *alone, solvers, started = curves(*POINTS)
    assert [curve.look.label for curve in alone] == ["SNUG", "Skinning alone"]
    assert [p.method for p in solvers.points] == ["lbfgs-5", "lbfgs-20", "newton-4"]
    assert [p.method for p in solvers.aside] == ["newton-1"]
    assert [p.method for p in started.points] == ["snug+lbfgs-1", "snug+lbfgs-4"]
    assert started.look.colour == alone[0].look.colour != solvers.look.colour
    assert started.look.label == "SNUG + solver"
    assert len(curves("simulation-perturbed-1e-4")) == 1
