"""Curves of the plane of run time and error, and the labels that stand in place of a legend."""

from __future__ import annotations

import itertools

import numpy as np

from reports.figures.plane import (
    Label,
    boxes_along,
    draw_points,
    families,
    of_page_one,
    place_labels,
    write_labels,
)
from reports.figures.plotting import fit, new_figure
from reports.statistics.pareto import Point
from tests.reports.report_folder import row, run_of

# method: run time, error
POINTS = {
    "snug": (0.2, 0.02), "skinning": (0.1, 0.6), "lbfgs-5": (8.0, 0.016), "lbfgs-20": (13.0, 0.0018),
    "newton-1": (10.0, 0.26), "newton-4": (24.0, 0.0008), "snug+lbfgs-1": (7.0, 0.015),
    "snug+lbfgs-4": (7.5, 0.014), "simulation-perturbed-1e-4": (40.0, 1e-9),
}  # fmt: skip


def points_and_run(*methods: str):
    methods = methods or tuple(POINTS)
    return [Point(name, *POINTS[name]) for name in methods], run_of([row(method=name) for name in methods])


def test_a_family_is_one_curve_in_the_order_of_its_level():
    points, run = points_and_run("newton-4", "snug", "newton-1")
    newton, snug = families(run, points)
    assert [point.method for point in newton.points] == ["newton-1", "newton-4"]
    assert (newton.ends, snug.ends) == (("Newton, 1", "4"), ("SNUG", ""))


def test_solvers_stopped_early_are_one_curve_of_page_one():
    points, run = points_and_run()
    *alone, solvers, started = of_page_one(run, points)
    assert [curve.ends[0] for curve in alone] == ["SNUG", "Skinning alone"]
    assert [p.method for p in solvers.points] == ["lbfgs-5", "lbfgs-20", "newton-4"]
    assert [p.method for p in solvers.aside] == ["newton-1"]
    assert solvers.ends == ("Solvers stopped early: L-BFGS, 5 iterations", "Newton, 4 iterations")
    assert [p.method for p in started.points] == ["snug+lbfgs-1", "snug+lbfgs-4"]
    assert started.look.colour == alone[0].look.colour != solvers.look.colour


def test_variants_of_the_reference_are_on_page_one_where_nothing_else_is():
    points, run = points_and_run("simulation-perturbed-1e-4")
    assert [curve.points for curve in of_page_one(run, points)] == [points]


def test_points_at_or_below_the_simulation_are_on_the_edge_not_lost():
    axes = new_figure(3, 3).subplots()
    run = run_of([row(method=method) for method in ("snug", "newton-8")])
    points = [Point("snug", 1.0, 0.2), Point("newton-8", 9.0, -0.1)]
    drawn = draw_points(axes, run, families(run, points), 20.0, band=0.0)
    assert drawn.below == {"newton-8"}
    low, high = axes.get_ylim()
    heights = [line[0, 1] for line in drawn.lines if len(line) == 1]
    assert len(heights) == 2 and all(low < height < high for height in heights)


def boxes_of_texts(axes) -> dict[str, np.ndarray]:
    """Text -> left, bottom, right, top [pixel]."""
    return {text.get_text(): text.get_window_extent().extents for text in axes.texts}


def overlap(one: np.ndarray, other: np.ndarray) -> bool:
    return bool((one[:2] < other[2:]).all() and (other[:2] < one[2:]).all())


def test_every_curve_has_its_label_and_no_two_labels_cover_each_other():
    figure = new_figure(6.7, 2.3)
    axes = figure.subplots()
    points, run = points_and_run()
    drawn = draw_points(axes, run, families(run, points), 40.0, band=0.0005)
    fit(figure)
    write_labels(axes, drawn)
    boxes = boxes_of_texts(axes)
    assert {"SNUG", "Skinning alone", "Newton, 1", "SNUG + L-BFGS, 1 to 4"} <= set(boxes)
    assert not [pair for pair in itertools.combinations(boxes.values(), 2) if overlap(*pair)]
    frame = axes.get_window_extent().extents
    assert all((frame[:2] <= box[:2]).all() and (box[2:] <= frame[2:]).all() for box in boxes.values())


def test_a_label_avoids_a_line():
    figure = new_figure(3, 2)
    axes = figure.subplots()
    axes.set(xlim=(0, 10), ylim=(0, 10))
    fit(figure)
    beside = boxes_along(axes, np.array([[5.3, 0.0], [5.3, 10.0]]), 3.0)
    place_labels(axes, [Label("here", (5.0, 5.0), "black")], beside)
    (box,) = boxes_of_texts(axes).values()
    assert box[2] < beside[:, 0].min()
