"""Styles of methods and figures of the report."""

from __future__ import annotations

import numpy as np

from reports.figures import plotting
from reports.figures.charts import dots
from reports.figures.plotting import file_name, printable
from reports.finished_run import shown_seeds
from tests.reports.report_folder import row, run_of


def test_methods_keep_their_order_and_their_look():
    names = ["zebra", "newton-8", "snug", "newton-2", "simulation", "newton-16", "skinning"]
    run = run_of([row(method=name) for name in names])
    known = ["simulation", "skinning", "snug", "zebra", "newton-2", "newton-8", "newton-16"]
    assert run.ordered(names) == known
    assert plotting.style(run, "newton-2").label == "Newton, 2 iterations"
    assert plotting.style(run, "newton-2").colour == plotting.style(run, "newton-16").colour
    assert plotting.style(run, "newton-2").line != plotting.style(run, "newton-8").line
    assert plotting.style(run, "zebra") == plotting.style(run_of([row(method="zebra")]), "zebra")
    colours = [look.colour for look in plotting.KNOWN.values() if look.colour]
    assert len(set(colours)) == len(colours)


def test_what_starts_from_a_method_has_its_colour_and_an_ablation_its_marker():
    run = run_of([row(method=m) for m in ("snug", "snug+lbfgs-4", "snug-no-inertia", "snug+cleanup")])
    base, less, warm, cleaned = (
        plotting.style(run, m) for m in ("snug", "snug-no-inertia", "snug+lbfgs-4", "snug+cleanup")
    )
    assert warm.colour == cleaned.colour == base.colour != less.colour
    assert less.marker == base.marker and warm.marker != base.marker
    family = plotting.family_style(run, run.methods["snug+lbfgs-4"])
    assert (family.label, warm.label) == ("SNUG + L-BFGS", "SNUG + L-BFGS, 4 iterations")
    alone = run_of([row(method="snug+cleanup")])  # what it starts from did not run
    assert plotting.style(alone, "snug+cleanup").label == "SNUG, cleaned up"


def test_a_roll_out_of_the_user_is_shown_where_there_is_no_room_for_all():
    rows = [row(method=f"solver-{k}", role="solver") for k in range(plotting.ROOM)]
    run = run_of([*rows, row(method="mine", role="external"), row(method="simulation")])
    assert plotting.leading(run, run.methods) == ["simulation", "mine"]


def test_a_panel_of_curves_shows_five_methods_the_reference_and_the_users_among_them():
    names = ("skinning", "untrained", "snug", "supervised", "pbns", "snug+cleanup", "simulation")
    run = run_of([*(row(method=name) for name in names), row(method="mine", role="external")])
    five = ["simulation", "skinning", "snug", "pbns", "mine"]
    assert sorted(plotting.few(run, run.methods)) == sorted(five)


def test_a_dot_stands_for_each_motion_and_seed():
    rows = [
        row(s, "snug", "energy/total", v, seed=k)
        for s in ("tshirt/a", "tshirt/b")
        for k, v in enumerate((1, 3))
    ]
    (drawing,) = dots(run_of(rows))
    marks, bar = drawing.canvas.axes[0].get_lines()
    assert sorted(marks.get_xdata()) == [1.0, 1.0, 3.0, 3.0] and list(bar.get_xdata()) == [2.0, 2.0]
    assert drawing.canvas.axes[0].get_xlabel() == "Total [J]"
    assert list(dots(run_of([row("flag", garment="")]))) == []


def test_a_metric_that_no_leading_method_has_takes_no_panel_of_dots():
    solvers = [f"solver-{k}" for k in range(plotting.ROOM)]
    rows = [row("tshirt/a", m, "curvature/error", 1.0, role="solver") for m in solvers]
    rows += [row("tshirt/a", m, "energy/total", 2.0) for m in ("simulation", "snug")]
    (drawing,) = dots(run_of(rows))
    assert [axes.get_xlabel() for axes in drawing.canvas.axes] == ["Total [J]"]


def test_dots_of_relative_excess_stand_on_a_logarithmic_axis_on_both_sides_of_zero():
    values = {"simulation": (1.0, 1.0), "skinning": (2.0, 2.0), "snug": (0.9, 41.0)}
    rows = [
        row(scene, method, "energy/total", value)
        for method, of_scenes in values.items()
        for scene, value in zip(("tshirt/a", "tshirt/b"), of_scenes)
    ]
    (drawing,) = dots(run_of(rows))
    axes = drawing.canvas.axes[0]
    assert (axes.get_xlabel(), axes.get_xscale()) == ("Relative excess [%]", "asinh")
    lines = {float(np.mean(line.get_ydata())): line.get_xdata() for line in axes.get_lines()[::2]}
    assert np.allclose(sorted(lines[2.0]), [-10.0, 4000.0]) and np.allclose(lines[1.0], 100.0)
    bar = axes.get_lines()[5].get_xdata()[0]
    assert np.isclose(bar, np.sinh((np.arcsinh(-10.0) + np.arcsinh(4000.0)) / 2.0))
    low, high = axes.get_xlim()
    assert low < -10.0 and high > 4000.0 and list(axes.get_xticks()) == [0.0, 10.0, 1000.0, -10.0]


def test_names_in_any_letters_give_files_that_the_report_finds():
    assert (
        file_name("tshirt/跳跃@clip")
        == "tshirt-U-8DF3U-8DC3-clip"
        == file_name(printable("tshirt/跳跃@clip"))
    )


def test_the_first_seed_that_came_to_its_end_is_shown():
    bad = [row(value=None, status="diverged", reason="no end", method=m) for m in ("snug", "pbns")]
    rows = [*bad, row(seed=2), row(seed=1), row(method="skinning")]
    seeds = shown_seeds(run_of(rows).frame).loc["tshirt/walk"]
    assert seeds.to_dict() == {"snug": 1, "pbns": 0, "skinning": 0}
