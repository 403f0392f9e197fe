"""Error against run time in the report: fronts, profiles, break-even and what the summary says of them."""

from __future__ import annotations

import dataclasses

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from reports import build
from reports.blocks import page_one_sentences
from reports.blocks.page_one_sentences import headline
from reports.figures.break_even import BreakEven
from reports.figures.error_against_time import ErrorOfPageOne, ErrorsOfScene, ErrorsOfScenes
from reports.figures.figure import Drawing, save_drawing
from reports.figures.plotting import _columns
from reports.statistics.break_even import Cost, compared_scenes, cost_of, crossing, rivals
from reports.statistics.pareto import (
    Point,
    beaten_by,
    fastest,
    front,
    indistinct,
    overtaken,
    points_of,
    run_time,
    solvers,
    truncated,
)
from reports.tables import make_tables
from reports.tables.speed import crossings, error_rivals, reference_uncertainty
from tests.reports.report_folder import declaration, run_of
from tests.reports.report_folder import row as any_row

# method: ms a frame, relative energy gap, curvature error
WORN = {
    "simulation": (100.0, 0.0, None),
    "newton-1": (12.0, 0.2, 3.0),
    "newton-4": (45.0, 0.01, 1.0),
    "lbfgs-5": (4.0, 0.3, 4.0),
    "lbfgs-20": (16.0, 0.05, 2.0),
    "skinning": (0.1, 1.0, 4.5),
    "snug": (0.25, 0.1, 5.0),
    "snug+lbfgs-1": (1.0, 0.08, 2.5),
    "snug+lbfgs-4": (50.0, 0.02, 1.5),
}
SCENES = ("tshirt/walk", "tshirt/jump")


def row(scene, method, metric, value, unit="1") -> Row:
    return any_row(scene, method, metric, value, suite="speed", unit=unit)


FIGURES = (ErrorOfPageOne(), ErrorsOfScene(), ErrorsOfScenes(), BreakEven())


def cost_sentence(run) -> str:
    """The sentence of page one on cost, without which nothing is said of rivals."""
    return dict(headline(run)).get("At what cost", "").replace("\u00a0", " ")


def all_rows() -> list[Row]:
    rows = []
    for scene in SCENES:
        for method, (time, gap, curvature) in WORN.items():
            rows += [row(scene, method, "cost/frame", time, "ms"), row(scene, method, "gap/energy", gap)]
            rows.append(row(scene, method, "gap/relative", gap))
            if curvature is not None:
                rows.append(row(scene, method, "curvature/error", curvature, "1/m"))
                rows.append(row(scene, method, "distance/rms", 10.0 * curvature, "mm"))
        rows.append(row(scene, "snug", "cost/train", 200.0, "s"))
        rows.append(row(scene, "snug", "cost/data", 0.0, "s"))
        rows.append(row(scene, "simulation-perturbed-1e-4", "distance/rms", 21.0, "mm"))
        rows.append(row(scene, "simulation", "gap/refrozen", 0.015, "J"))
    for method in ("simulation", "newton-1", "newton-4"):
        time, gap, _ = WORN[method]
        rows += [row("sheet", method, "cost/frame", time, "ms"), row("sheet", method, "gap/energy", gap)]
        rows.append(row("sheet", method, "gap/relative", gap))
    return rows


def test_a_legend_has_no_more_columns_than_fit():
    assert _columns([20, 20, 20]) == 3
    assert _columns([20] * 10) == 5
    assert _columns([200, 10]) == 1
    assert _columns([20] * 5, 0.5) == 2
    longest = [30, 10] * 4  # two lines: each column holds a long one
    assert _columns(longest) == 3


def test_the_front_holds_those_that_nothing_beats():
    points = [Point("a", 1.0, 5.0), Point("b", 2.0, 6.0), Point("c", 3.0, 1.0), Point("d", 3.0, 2.0)]
    assert [p.method for p in front(points)] == ["a", "c"]
    assert fastest(points, 2.0) == points[2]
    assert fastest(points, 0.5) is None


def test_points_need_every_scene():
    run = run_of(all_rows())
    everywhere = points_of(run, run.cells("speed"), ["sheet", *SCENES], "gap/energy")
    assert [p.method for p in everywhere] == ["simulation", "newton-1", "newton-4"]
    worn = points_of(run, run.cells("speed"), SCENES, "gap/energy")
    alone = {"newton-1", "newton-4", "lbfgs-5", "lbfgs-20"}
    assert {p.method for p in solvers(run, worn)} == {"simulation", *alone}
    assert {p.method for p in truncated(run, worn)} == alone


def test_run_time_is_from_pose_to_vertices_where_every_timed_cell_has_that(tmp_path):
    rows = all_rows()
    own = [r for r in rows if r.metric == "cost/frame"]
    whole = [dataclasses.replace(r, metric="cost/whole", value=r.value + 2.0) for r in own]
    rows.append(row(SCENES[0], "skinning", "cost/spread", 50.0, "%"))
    for added, shift in ((whole, 2.0), (whole[1:], 0.0), ([], 0.0)):
        run = run_of([*rows, *added])
        cells = run.cells("speed")
        scene = cells[cells["scene"] == SCENES[0]]
        (point,) = (
            p
            for p in points_of(run, scene, SCENES[:1], "gap/energy", run_time(scene))
            if p.method == "skinning"
        )
        assert point.time == pytest.approx(0.1 + shift) and point.time_spread == pytest.approx(0.05)
        assert run_time(scene) == ("cost/whole" if shift else "cost/frame")
        assert ErrorOfPageOne().drawings(run)


def test_break_even_is_where_the_total_costs_cross():
    network, solver = Cost("snug", 200.0, 0.001), Cost("simulation", 0.0, 0.101)
    frames = crossing(network, solver)
    assert frames == pytest.approx(2000.0)
    assert network.total(frames) == pytest.approx(solver.total(frames))
    assert crossing(solver, network) is None
    assert crossing(Cost("snug", 200.0, 0.2), solver) is None


def test_what_comes_before_the_first_frame_is_data_making_ready_and_training():
    costs = {"cost/data": 5.0, "cost/setup": 20.0, "cost/train": 200.0}
    rows = [row("tshirt/walk", "supervised", metric, value, "s") for metric, value in costs.items()]
    rows.append(row("tshirt/walk", "supervised", "cost/frame", 2.0, "ms"))
    assert cost_of(run_of(rows).frame, "supervised", ("tshirt/walk",)) == Cost("supervised", 225.0, 0.002)


def test_rivals_are_the_fastest_solvers_as_accurate():
    run = run_of(all_rows())
    found = rivals(run, run.cells("speed"), list(SCENES))
    assert found == {"simulation": "converged", "lbfgs-20": "energy gap", "lbfgs-5": "curvature error"}


def test_a_run_time_spreads_as_its_repeats_do_else_as_its_seeds():
    rows = [row(SCENES[0], "newton-1", m, v) for m, v in (("cost/frame", 10.0), ("gap/energy", 0.2))]
    rows += [
        dataclasses.replace(row(SCENES[0], "snug", metric, value), seed=seed)
        for seed, time in ((0, 1.0), (1, 3.0))
        for metric, value in (("cost/frame", time), ("gap/energy", 0.1))
    ]
    run = run_of(rows)
    points = points_of(run, run.cells("speed"), SCENES[:1], "gap/energy")
    spreads = {p.method: p.time_spread for p in points}
    assert spreads == {"newton-1": 0.0, "snug": pytest.approx(2.0 * 2.0**0.5)}  # twice the deviation
    rows.append(row(SCENES[0], "newton-1", "cost/spread", 25.0, "%"))
    run = run_of(rows)
    (again,) = solvers(run, points_of(run, run.cells("speed"), SCENES[:1], "gap/energy"))
    assert again.time_spread == 2.5  # [ms] from the fastest repeat to the slowest


def test_a_training_whose_data_nobody_can_price_has_no_break_even():
    rows = [r for r in all_rows() if r.metric != "cost/data"]
    run = run_of(rows)
    frame = run.cells("speed")
    assert cost_of(frame, "snug", SCENES) is None and cost_of(frame, "newton-1", SCENES) is not None
    assert crossings(run) == []


def test_as_fast_is_within_the_scatter_of_run_times():
    point, twin = Point("snug", 0.350, 4.2, 0.008), Point("supervised", 0.357, 3.7, 0.006)
    assert overtaken(point, [twin]) and beaten_by([point, twin], point) is twin
    assert not overtaken(twin, [point])  # which is less accurate
    slower = dataclasses.replace(twin, time=0.361)
    assert not overtaken(point, [slower]) and beaten_by([point, slower], point) is None
    assert not overtaken(
        Point("snug", 0.350, 4.2), [Point("supervised", 0.357, 3.7)]
    )  # no repeats: no scatter


def test_a_rival_is_no_faster_for_repeats_that_scatter():
    point, wide = Point("snug", 1.36, 0.53, 0.1), Point("snug+lbfgs-1", 19.1, 0.32, 19.6)
    assert beaten_by([point, wide], point) is None
    shaky = dataclasses.replace(point, time_spread=20.0)
    assert beaten_by([shaky, wide], shaky) is None
    rows = [row(SCENES[0], "snug", "cost/spread", 10.0, "%")] + [
        row(SCENES[0], method, metric, value)
        for method, time, gap in (("snug", 1.0, 0.3), ("pbns", 1.05, 0.2), ("newton-1", 12.0, 0.1))
        for metric, value in (("cost/frame", time), ("gap/energy", gap))
    ]
    rows += [row(SCENES[0], "simulation", "cost/frame", 100.0, "ms")]
    assert "PBNS is no slower within repeats and has an energy gap of 0.200 J, below" in cost_sentence(
        run_of(rows)
    )


def test_a_solver_in_a_whole_motion_takes_no_clip_off_page_one():
    """The energy gap is measured in suite speed alone."""
    whole = [
        any_row("tshirt/kick", method, "cost/frame", time, unit="ms")
        for method, time in (("snug", 0.3), ("newton-4", 50.0), ("simulation", 100.0))
    ]
    run, alone = run_of([*all_rows(), *whole]), run_of(all_rows())
    frame = run.cells("speed", "garments")
    assert compared_scenes(run, frame) == {"tshirt": sorted(SCENES, reverse=True)}
    assert cost_sentence(run) == cost_sentence(alone)
    assert error_rivals(run) == error_rivals(alone)
    assert compared_scenes(run_of(whole), run_of(whole).frame) == {"tshirt": ["tshirt/kick"]}


def test_a_point_is_of_the_seeds_that_did_every_scene():
    rows = [
        dataclasses.replace(row(scene, "snug", metric, value), seed=seed)
        for seed, values in ((0, (1.0, 3.0)), (1, (9.0, None)))
        for scene, value in zip(SCENES, values)
        for metric in ("cost/frame", "gap/energy")
        if value is not None
    ]
    gone = {"value": None, "seed": 1, "status": "diverged", "reason": "no end"}
    rows.append(dataclasses.replace(row(SCENES[1], "snug", "cost/frame", 0.0), **gone))
    (found,) = points_of(run_of(rows), run_of(rows).frame, SCENES, "gap/energy")
    assert (found.time, found.error, found.fewer) == (2.0, 2.0, " (2 of 4 roll-outs)")


def test_a_training_without_rivals_has_no_crossings():
    rows = [r for r in all_rows() if r.method in ("snug", "snug+lbfgs-1") and r.metric != "gap/energy"]
    rows = [r for r in rows if r.metric != "curvature/error"]
    assert crossings(run_of(rows)) == []


def test_run_times_on_page_one_are_of_the_garment_compared():
    rows = all_rows() + [row("skirt/stop", m, "cost/frame", 500.0, "ms") for m in ("snug", "simulation")]
    assert cost_sentence(run_of(rows)).startswith(
        "SNUG takes 0.250 ms a frame on one core in 2 scenes, the simulation 400 times as long. SNUG has an "
    )


def test_the_table_of_crossings_has_every_network_and_the_figure_those_it_has_room_for(tmp_path):
    more = [f"snug-{k}" for k in range(9)]
    costs = (("cost/frame", 0.25), ("cost/train", 9.0), ("cost/data", 0.0))
    rows = [
        dataclasses.replace(row(scene, method, *cost), role="ablation")
        for scene in SCENES
        for method in more
        for cost in costs
    ]
    (table,) = crossings(run_of(all_rows() + rows))
    assert {line[1] for line in table.rows} == {"snug", *more}


def test_ablations_are_drawn_where_the_full_recipe_is_not():
    costs = (("cost/frame", 1.0), ("gap/energy", 0.1))
    rows = [row("tshirt/walk", m, k, v) for m in ("snug-springs", "newton-1") for k, v in costs]
    (drawing,) = (part for figure in FIGURES for part in figure.drawings(run_of(rows)))
    assert drawing.name == "error_against_time"
    rows += [row("tshirt/walk", "snug", *cost) for cost in costs]
    kept = [r for r in rows if r.method != "newton-1"]
    assert [figure.drawings(run_of(kept)) for figure in FIGURES] == [[]] * 4  # one point is no plot


def test_every_network_has_its_crossings_in_a_table():
    (table,) = crossings(run_of(all_rows()))
    found = {line[2]: line[4:6] for line in table.rows}
    assert {line[2]: line[3] for line in table.rows}["lbfgs-20"] == "energy gap"
    assert {line[1] for line in table.rows} == {"snug"}
    assert found["simulation"] == (2000.0, pytest.approx(200.5, rel=1e-3))
    assert {line[2]: line[6:] for line in table.rows}["simulation"] == (pytest.approx(200.0), 400.0)
    assert found["lbfgs-20"][0] == 13000.0 and set(found) == {"simulation", "lbfgs-20", "lbfgs-5"}
    others = run_of([r for r in all_rows() if "snug" not in r.method])
    assert crossings(others) == error_rivals(others) == []


def test_garments_have_crossings_by_themselves():
    rows = all_rows()
    # Where no truncated solver was timed, nothing says how fast a solver as good would be.
    rows += [dataclasses.replace(r, scene="skirt/stop", garment="skirt") for r in rows if r.method == "snug"]
    rows += [
        dataclasses.replace(r, scene="tunic/stop", garment="tunic", value=4.0 * r.value)
        for r in rows
        if r.scene == SCENES[0]
    ]
    run = run_of(rows)
    assert list(compared_scenes(run, run.cells("speed"))) == ["tshirt", "tunic"]
    (table,) = crossings(run)
    found = {line[0]: line[4] for line in table.rows if line[2] == "simulation"}
    assert found == {"tshirt": 2000.0, "tunic": 2000.0}


def test_page_one_and_a_table_say_what_beats_the_network_and_when_training_pays():
    run = run_of(all_rows())
    assert cost_sentence(run).endswith(
        " SNUG has an energy gap, the energy above the minimum of each time step, of 0.100 J; no other "
        "method that is at least as fast has a smaller gap. The fastest solver stopped early whose gap is no "
        "larger is L-BFGS, 20 iterations, 16.0 ms a frame."
    )
    (table,) = error_rivals(run)
    assert table.rows == (
        ("Energy gap", 0.1, 0.25, "", None, None, "lbfgs-20", 16.0),
        ("Curvature error [1/m]", 5.0, 0.25, "skinning", 4.5, 0.1, "lbfgs-5", 4.0),
    )
    (table,) = crossings(run)
    paid = {line[2]: (line[4], line[6]) for line in table.rows}
    assert paid == {method: (frames, 200.0) for method, frames in
                    (("simulation", 2000.0), ("lbfgs-20", 13000.0), ("lbfgs-5", 53000.0))}  # fmt: skip


def test_the_reference_has_its_uncertainty_and_its_error_in_time_in_a_table():
    more = {"role": "reference-variant", "family": "simulation-dt", "level": 4.0}
    rows = [dataclasses.replace(row(SCENES[0], "simulation-dt-4", "distance/rms", 30.0, "mm"), **more)]
    (table,) = reference_uncertainty(run_of(all_rows() + rows))
    assert [column.name for column in table.columns] == ["of", "curvature/error", "distance/rms"]
    assert table.rows == (
        ("ensemble of the reference, root mean square", None, 21.0), ("4 steps a frame", None, 30.0),
        ("SNUG", 5.0, 50.0),
    )  # fmt: skip


def test_nothing_is_nearer_of_those_that_were_looked_at():
    numbers = {"snug": ("a", "b"), "pbns": ("a",)}
    rows = [
        any_row(scene, method, metric, value / (1 + (method == "pbns")), suite="speed")
        for method, scenes in numbers.items()
        for scene in scenes
        for metric, value in (("gap/energy", 2.0), ("cost/frame", 4.0))
    ]
    run = run_of(rows)
    frame = run.cells("speed", "garments")
    (sentence,) = page_one_sentences._rivals(run, frame, ["a", "b"])
    others = "of the methods measured in all of these scenes, none that is at least as fast has a smaller gap"
    assert sentence.endswith(others)
    assert page_one_sentences._rivals(run, frame, ["a"])[0].startswith("PBNS is no slower")


@pytest.fixture(scope="module")
def drawings() -> list[Drawing]:
    run = run_of(all_rows())
    return [drawing for figure in FIGURES for drawing in figure.drawings(run)]


def test_every_figure_of_the_suite_is_drawn(drawings, tmp_path):
    run = run_of(all_rows())
    names = [
        "error_against_time",
        "error_against_time_tshirt-walk",
        "error_against_time_scenes",
        "break_even",
    ]
    assert [drawing.name for drawing in drawings] == names
    assert all(save_drawing(tmp_path, drawing).path.is_file() for drawing in drawings)
    assert "Grey: within the reference's uncertainty." in drawings[0].caption
    walk = run.frame[run.frame["scene"] == "tshirt/walk"]
    assert indistinct(run, walk, "distance/rms") == 21.0  # no rival of whom it may be said who is nearer
    assert indistinct(run, walk, "gap/energy") == 0.015 and indistinct(run, walk, "curvature/error") == 0.0


def test_no_axis_is_labelled_in_markup(drawings):
    """Names may hold dollars, so that no text is taken for a formula: neither are an axis's numbers."""
    assert len(drawings) == 4
    for canvas in (drawing.canvas for drawing in drawings):
        FigureCanvasAgg(canvas).draw()
        labels = [
            label.get_text()
            for axes in canvas.axes
            for label in (*axes.get_xticklabels(), *axes.get_yticklabels())
        ]
        assert any(labels) and not [label for label in labels if "$" in label]


def test_any_metric_against_any_other(tmp_path, capsys):
    run = RunFolder(tmp_path)
    run.write_config(declaration(all_rows()))
    run.write_rows(all_rows())
    assert build.main([str(tmp_path), "--axes", "distance/rms", "gap/energy"]) == 0
    assert (tmp_path / "figures/gap-energy_against_distance-rms.svg").is_file()
    capsys.readouterr()
    # Curvature exists on the dressed scenes alone, where most methods have it; zero has no place there.
    assert build.main([str(tmp_path), "--axes", "cost/frame", "curvature/error"]) == 0
    assert (tmp_path / "figures/curvature-error_against_cost-frame.svg").is_file()
    # Suites other than garments and speed have their metrics too. A single zero is left out, not the figure.
    far = [
        dataclasses.replace(row("fast", method, metric, value), suite="extremes")
        for method, value in (("simulation", 1.0), ("snug", 2.0), ("skinning", 0.0))
        for metric in ("motion/strain", "motion/offset")
    ]
    run.write_rows([*all_rows(), *far])
    assert build.main([str(tmp_path), "--axes", "motion/strain", "motion/offset"]) == 0
    assert (tmp_path / "figures/motion-offset_against_motion-strain.svg").is_file()
    assert "Left out, for motion/strain is zero: Skinning alone." in capsys.readouterr().out
    run.write_rows([*all_rows(), row("sheet", "newton-1", "curvature/error", 1.0)])
    assert build.main([str(tmp_path), "--axes", "cost/frame", "curvature/error"]) == 0
    run.write_rows([*all_rows(), row(SCENES[0], "newton-1", "lag", -1.0), row(SCENES[0], "snug", "lag", 1.0)])
    capsys.readouterr()
    for axes in (("lag", "gap/energy"), ("cost/frame", "lag")):
        assert build.main([str(tmp_path), "--axes", *axes]) == 2
        said = capsys.readouterr().err
        assert (
            said.count("\n") == 1 and "lag of newton-1 is -1: it has no place on a logarithmic axis" in said
        )
    assert build.main([str(tmp_path), "--axes", "cost/frame", "gap/nothing"]) == 2
    assert "no row has the metric 'gap/nothing'" in capsys.readouterr().err
    assert build.main([str(tmp_path), "--axes", "cost/frame", "gap/energy", "--scenes", "moon"]) == 2


def test_a_rival_within_the_uncertainty_of_the_reference_is_as_near():
    rows = [
        dataclasses.replace(
            row(SCENES[0], method, metric, value), uncertainty=None if metric == "cost/frame" else 0.3
        )
        for method, time, error in (("snug", 1.0, 5.3), ("pbns", 0.5, 5.0), ("newton-1", 12.0, 1.0))
        for metric, value in (("cost/frame", time), ("gap/energy", error))
    ]
    rows += [row(SCENES[0], "simulation", "cost/frame", 100.0, "ms")]
    sentence = cost_sentence(run_of(rows))
    assert "PBNS is no slower and has an energy gap of 5.00 J, below the 5.30 J of SNUG, by less" in sentence
    sure = [dataclasses.replace(r, uncertainty=0.1 if r.uncertainty else None) for r in rows]
    assert "below the 5.30 J of SNUG. The fastest" in cost_sentence(run_of(sure))


def test_a_run_of_suite_speed_alone_has_its_methods_on_page_one():
    made = make_tables(run_of(all_rows()))["overview"]
    assert {"simulation", "snug", "skinning"} < {line[0] for line in made.rows}
    assert "None" not in made.caption and all(scene in made.caption for scene in SCENES)
