"""Error against run time in the report: fronts, profiles, break-even and the answers in words."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.results import Row, RunFolder
from reports import build, palette
from reports.answers import answers, beaten_by, by_scene, overtaken
from reports.break_even import Cost, break_even, cost_of, crossing, crossings, rivals
from reports.canvas import _columns
from reports.fronts import Point, fastest, front, hybrids, points_of, solvers
from reports.profile import performance_profile, staircases, times_to_reach
from reports.summary import Measurements, speed_measurements
from reports.work_precision import error_against_time

# method: ms a frame, relative gap, curvature error
DRESSED = {
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
SCENES = ("dressed/walk", "dressed/jump")


def row(scene, method, metric, value, unit="1") -> Row:
    return Row(suite="speed", scene=scene, method=method, seed=0, metric=metric, unit=unit, value=value)


def all_rows() -> list[Row]:
    rows = []
    for scene in SCENES:
        for method, (time, gap, curvature) in DRESSED.items():
            rows += [row(scene, method, "cost/frame", time, "ms"), row(scene, method, "gap/relative", gap)]
            if curvature is not None:
                rows.append(row(scene, method, "curvature/error", curvature, "1/m"))
                rows.append(row(scene, method, "distance/rms", 10.0 * curvature, "mm"))
        rows.append(row(scene, "snug", "cost/train", 200.0, "s"))
        rows.append(row(scene, "snug", "cost/data", 0.0, "s"))
        rows.append(row(scene, "simulation", "distance/floor", 21.0, "mm"))
    for method in ("simulation", "newton-1", "newton-4"):
        time, gap, _ = DRESSED[method]
        rows += [row("sheet", method, "cost/frame", time, "ms"), row("sheet", method, "gap/relative", gap)]
    return rows


def test_names_of_families_cuts_and_hybrids():
    assert palette.cut_of("newton-4") == palette.Cut("newton", 4.0, "4")
    assert palette.cut_of("simulation-1e-4") == palette.Cut("simulation-tolerance", 4.0, "1e-4")
    assert palette.cut_of("simulation-dt/8") == palette.Cut("simulation-dt", 8.0, "dt/8")
    assert palette.cut_of("snug") is None and palette.cut_of("snug-no-bending") is None
    assert palette.is_hybrid("snug+lbfgs-4")
    assert not palette.is_hybrid("lbfgs-4") and not palette.is_hybrid("snug+cleanup")
    assert palette.label("snug+lbfgs-4") == "SNUG + L-BFGS, 4 iterations"
    assert palette.style("snug+newton-2").colour == palette.style("snug").colour
    assert palette.ordered(["a+newton-2", "lbfgs-10", "lbfgs-5", "snug"])[:2] == ["snug", "lbfgs-5"]


def test_a_legend_has_no_more_columns_than_fit():
    assert _columns([20, 20, 20]) == 3
    assert _columns([20] * 10) == 5
    assert _columns([200, 10]) == 1
    longest = [30, 10] * 4  # two lines: each column holds a long one
    assert _columns(longest) == 3


def test_the_front_holds_those_that_nothing_beats():
    points = [Point("a", 1.0, 5.0), Point("b", 2.0, 6.0), Point("c", 3.0, 1.0), Point("d", 3.0, 2.0)]
    assert [p.method for p in front(points)] == ["a", "c"]
    assert fastest(points, 2.0) == points[2]
    assert fastest(points, 0.5) is None


def test_points_need_every_scene():
    measured = speed_measurements(all_rows())
    everywhere = points_of(measured, ["sheet", *SCENES], "gap/relative")
    assert [p.method for p in everywhere] == ["simulation", "newton-1", "newton-4"]
    dressed = points_of(measured, SCENES, "gap/relative")
    assert {p.method for p in solvers(dressed)} == {
        "simulation",
        "newton-1",
        "newton-4",
        "lbfgs-5",
        "lbfgs-20",
    }
    assert {p.method for p in hybrids(dressed)} == {"snug+lbfgs-1", "snug+lbfgs-4"}


def test_a_profile_counts_scenes_within_a_ratio_of_the_fastest():
    times = times_to_reach(speed_measurements(all_rows()), ["sheet", *SCENES], 0.15)
    assert times["sheet"] == {"simulation": 100.0, "newton": 45.0}
    assert times["dressed/walk"]["snug"] == 0.25 and times["dressed/walk"]["lbfgs"] == 16.0
    stairs = staircases(times)
    ratios, shares = stairs["newton"]
    assert ratios[:3] == [1.0, 180.0, 180.0] and shares[:3] == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert stairs["snug"][1][-1] == pytest.approx(2 / 3)


def test_break_even_is_where_the_total_costs_cross():
    network, solver = Cost("snug", 200.0, 0.001), Cost("simulation", 0.0, 0.101)
    frames = crossing(network, solver)
    assert frames == pytest.approx(2000.0)
    assert network.total(frames) == pytest.approx(solver.total(frames))
    assert crossing(solver, network) is None
    assert crossing(Cost("snug", 200.0, 0.2), solver) is None


def test_what_comes_before_the_first_frame_is_data_making_ready_and_training():
    costs = {"cost/data": 5.0, "cost/setup": 20.0, "cost/train": 200.0}
    rows = [row("dressed/walk", "supervised", metric, value, "s") for metric, value in costs.items()]
    rows.append(row("dressed/walk", "supervised", "cost/frame", 2.0, "ms"))
    assert cost_of(Measurements(rows), "supervised", ("dressed/walk",)) == Cost("supervised", 225.0, 0.002)


def test_rivals_are_the_fastest_solvers_as_accurate():
    found = rivals(speed_measurements(all_rows()), list(SCENES))
    assert found == {"simulation": "converged", "lbfgs-20": "energy gap", "lbfgs-5": "curvature error"}


def test_the_answers_follow_the_numbers():
    said = dict(answers(all_rows()))
    assert "400 times faster" in said["Run time"]
    assert "nothing as fast as SNUG" in said["Where SNUG wins"]
    assert "is not on the front: Skinning alone has 4.50" in said["Where SNUG wins"]
    assert "L-BFGS, 20 iterations: 0.0500 in 16.0 ms, 64 times" in said["A few iterations"]
    assert "1 of 2 SNUG-started solvers" in said["Network plus solver"]
    assert "after 2,000 frames" in said["When training pays"]
    assert "after 13,000 frames" in said["When training pays"]


def test_a_run_time_spreads_as_its_repeats_do_else_as_its_seeds():
    rows = [row(SCENES[0], "newton-1", m, v) for m, v in (("cost/frame", 10.0), ("gap/relative", 0.2))]
    rows += [
        dataclasses.replace(row(SCENES[0], "snug", metric, value), seed=seed)
        for seed, time in ((0, 1.0), (1, 3.0))
        for metric, value in (("cost/frame", time), ("gap/relative", 0.1))
    ]
    spreads = {
        p.method: p.time_spread for p in points_of(speed_measurements(rows), SCENES[:1], "gap/relative")
    }
    assert spreads == {"newton-1": 0.0, "snug": pytest.approx(2.0 * 2.0**0.5)}  # twice the deviation
    rows.append(row(SCENES[0], "newton-1", "cost/spread", 25.0, "%"))
    (again,) = solvers(points_of(speed_measurements(rows), SCENES[:1], "gap/relative"))
    assert again.time_spread == 2.5  # [ms] from the fastest repeat to the slowest


def test_a_training_whose_data_nobody_can_price_has_no_break_even():
    rows = [r for r in all_rows() if r.metric != "cost/data"]
    measured = speed_measurements(rows)
    assert cost_of(measured, "snug", SCENES) is None and cost_of(measured, "newton-1", SCENES) is not None
    assert crossings(rows) is None


def test_as_fast_is_within_the_scatter_of_run_times():
    point, twin = Point("snug", 0.350, 4.2, 0.008), Point("supervised", 0.357, 3.7, 0.006)
    assert overtaken(point, [twin]) and beaten_by([point, twin], point) is twin
    assert not overtaken(twin, [point])  # which is less accurate
    slower = dataclasses.replace(twin, time=0.361)
    assert not overtaken(point, [slower]) and beaten_by([point, slower], point) is None
    assert not overtaken(
        Point("snug", 0.350, 4.2), [Point("supervised", 0.357, 3.7)]
    )  # no repeats: no scatter


def test_hybrids_may_lose_to_the_network_itself():
    rows = [r for r in all_rows() if "+" not in r.method]
    numbers = (("cost/frame", 1.0), ("gap/relative", 0.1))  # slower than SNUG and no better
    rows += [row(scene, "snug+lbfgs-1", *pair) for scene in SCENES for pair in numbers]
    said = dict(answers(rows))["Network plus solver"]
    assert said == (
        "By energy gap every SNUG-started solver is beaten by SNUG itself or by a solver alone that is no "
        "slower. (mean of 2 scenes.)"
    )


def test_run_times_are_of_the_scenes_that_both_have():
    rows = [r for r in all_rows() if (r.method, r.scene) != ("simulation", SCENES[0])]
    rows += [row(SCENES[0], "snug", "cost/train", 200.0, "s")]
    rows = [dataclasses.replace(r, value=9.0) if _is(r, SCENES[0], "snug", "cost/frame") else r for r in rows]
    assert dict(answers(rows))["Run time"].endswith("100 ms: 400 times faster (1 scene only).")


def _is(found, *wanted):
    return (found.scene, found.method, found.metric) == wanted


def test_ablations_are_drawn_where_the_full_recipe_is_not(tmp_path):
    costs = (("cost/frame", 1.0), ("gap/relative", 0.1))
    rows = [row("dressed/walk", m, k, v) for m in ("snug-springs", "newton-1") for k, v in costs]
    assert len(error_against_time(tmp_path, rows)) == 1
    rows += [row("dressed/walk", "snug", *cost) for cost in costs]
    kept = [r for r in rows if r.method != "newton-1"]
    assert error_against_time(tmp_path, kept) == []  # one point is no plot


def test_the_same_scene_by_scene():
    worse = ("skinning+lbfgs-1", 0.5, 0.5)  # than SNUG, though no solver alone is as fast
    rows = [*all_rows(), row(SCENES[0], worse[0], "cost/frame", worse[1], "ms")]
    table = by_scene([*rows, row(SCENES[0], worse[0], "gap/relative", worse[2])])
    assert table is not None and [line[:2] for line in table.rows[:2]] == [
        ("dressed/walk", "energy gap"),
        ("dressed/walk", "mean-curvature error"),
    ]
    gap, curvature = table.rows[:2]
    assert gap[4:6] == ("none", "L-BFGS, 20 iterations, 16.0\u00a0ms") and gap[7:] == (2000.0, 13000.0)
    assert gap[6] == "SNUG + L-BFGS, 1 iteration, 1.00\u00a0ms"
    assert curvature[4:6] == ("Skinning alone, 0.100\u00a0ms", "L-BFGS, 5 iterations, 4.00\u00a0ms")


def test_every_network_has_its_crossings_in_a_table():
    table = crossings(all_rows())
    assert table is not None
    found = {line[2]: line[3:] for line in table.rows}
    assert {line[1] for line in table.rows} == {"snug"}
    assert found["Simulation"] == (2000.0, pytest.approx(200.5, rel=1e-3))
    assert found["L-BFGS, 20 iterations"][0] == 13000.0 and set(found) == {
        "Simulation", "L-BFGS, 20 iterations", "L-BFGS, 5 iterations",
    }  # fmt: skip
    assert crossings([r for r in all_rows() if "snug" not in r.method]) is None


def test_garments_are_answered_for_by_themselves():
    rows = all_rows()
    rows += [dataclasses.replace(r, scene="tunic/stop") for r in rows if r.scene == SCENES[0]]
    said = dict(answers(rows))["When training pays"]
    assert said.startswith("T-shirt: ") and said.count("Tunic: ") == 1
    assert said.count("after 2,000 frames") == 2


def test_without_networks_nothing_is_said():
    rows = [r for r in all_rows() if "snug" not in r.method]
    assert by_scene(rows) is None
    assert not any(words for _, words in answers(rows))


def test_every_figure_of_the_suite_is_drawn(tmp_path):
    rows = all_rows()
    pictures = (
        error_against_time(tmp_path, rows) + performance_profile(tmp_path, rows) + break_even(tmp_path, rows)
    )
    assert len(pictures) == 5 and all(p.path.is_file() for p in pictures)
    assert "Grey: under 21.0 mm" in pictures[0].caption
    assert "SNUG overtakes Simulation at 2,000 frames (3.34 min)" in pictures[-1].caption


def test_any_metric_against_any_other(tmp_path, capsys):
    run = RunFolder(tmp_path)
    run.write_rows(all_rows())
    assert build.main([str(tmp_path), "--axes", "distance/rms", "gap/relative"]) == 0
    assert (tmp_path / "figures/gap-relative_against_distance-rms.svg").is_file()
    capsys.readouterr()
    # Curvature exists on the dressed scenes alone, where most methods have it; zero has no place there.
    assert build.main([str(tmp_path), "--axes", "cost/frame", "curvature/error"]) == 0
    assert (tmp_path / "figures/curvature-error_against_cost-frame.svg").is_file()
    run.write_rows([*all_rows(), row("sheet", "newton-1", "curvature/error", 1.0)])
    assert build.main([str(tmp_path), "--axes", "cost/frame", "curvature/error"]) == 0
    run.write_rows([*all_rows(), row(SCENES[0], "newton-1", "lag", -1.0), row(SCENES[0], "snug", "lag", 1.0)])
    capsys.readouterr()
    for axes in (("lag", "gap/relative"), ("cost/frame", "lag")):
        assert build.main([str(tmp_path), "--axes", *axes]) == 2
        said = capsys.readouterr().err
        assert (
            said.count("\n") == 1 and "lag of newton-1 is -1: it has no place on a logarithmic axis" in said
        )
    assert build.main([str(tmp_path), "--axes", "cost/frame", "gap/nothing"]) == 2
    assert "no row has the metric 'gap/nothing'" in capsys.readouterr().err
    assert build.main([str(tmp_path), "--axes", "cost/frame", "gap/relative", "--scenes", "moon"]) == 2
