"""Errors of textile tests against run time: solvers stopped early, members of a family joined."""

from __future__ import annotations

from collections.abc import Iterator

from reports.figures.figure import Drawing
from reports.figures.plane import draw_points, families, write_labels
from reports.figures.plotting import LABELLED, fit, new_panels
from reports.run.finished_run import Run
from reports.statistics.fabric.order import ERROR, rows_of_test
from reports.statistics.means_and_spreads import value_of
from reports.statistics.pareto import TIME, Point, indistinct, points_of

PANELS = {
    "cantilever": "Bending length: error [%]",
    "drape": "Drape coefficient: error [points]",
}
VARIANTS = ("reference-variant",)  # of the reference, whose spread is the error bar


def points_of_tests(run: Run) -> dict[str, list[Point]]:
    """Return test -> points of the methods that did it with every fabric."""
    points = {}
    for test in PANELS:
        rows = rows_of_test(run, test)
        rows = rows[~rows["role"].isin(VARIANTS)]
        points[test] = points_of(run, rows, sorted(set(rows["scene"])), ERROR, TIME)
    return {test: of_test for test, of_test in points.items() if len(of_test) > 1}


def textile_errors(run: Run) -> Iterator[Drawing]:
    """Draw a panel for each textile test: mean error over the fabrics against run time."""
    tests = points_of_tests(run)
    if not tests:
        return
    figure, panels = new_panels(len(tests), 2)
    drawn = []
    for axes, (test, points) in zip(panels, tests.items()):
        rows = rows_of_test(run, test)
        reference, band = value_of(rows, run.reference, TIME), indistinct(run, rows, ERROR)
        drawn.append(draw_points(axes, run, families(run, points), reference, band))
        axes.set(xlabel="run time [ms per frame]", title=PANELS[test])
    fit(figure, height=LABELLED)
    for axes, panel in zip(panels, drawn):
        write_labels(axes, panel)
    caption = (
        "Textile tests: mean error over the fabrics against run time; lower left is better. Bending "
        "length: distance from the exact one. Drape coefficient: difference from the reference's; bars: "
        "the change by a perturbed reference. Dotted: the reference's run time. Joined: a family, "
        "its first and last number beside."
    )
    if any(panel.band for panel in drawn):
        caption += " Grey: no more than that of the reference and of its perturbed runs."
    yield Drawing(figure, "textile_errors", caption)
