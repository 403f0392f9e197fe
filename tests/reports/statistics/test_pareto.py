"""Points of run time and error: fronts, what beats what, how run times scatter, break-even."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.results.row import Row
from reports.statistics.pareto import (
    Point,
    front,
    noise_floor,
    points_of,
    rivals,
    run_time,
    solvers,
)
from tests.reports import report_folder
from tests.reports.report_folder import SCENES, run_of

# Run times [ms], gaps and errors of curvature of solvers and networks in two worn scenes.
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


def row(scene, method, metric, value, unit="1", **more) -> Row:
    return report_folder.row(scene, method, metric, value, **{"suite": "speed", "unit": unit, **more})


def all_rows() -> list[Row]:
    rows = []
    for scene in SCENES:
        for method, (time, gap, curvature) in WORN.items():
            rows += [row(scene, method, "cost/frame", time, "ms"), row(scene, method, "gap/energy", gap)]
            if curvature is not None:
                rows.append(row(scene, method, "curvature/histogram", curvature, "1/m"))
    for method in ("simulation", "newton-1", "newton-4"):
        time, gap, _ = WORN[method]
        rows += [row("sheet", method, "cost/frame", time, "ms"), row("sheet", method, "gap/energy", gap)]
    return rows


def test_the_front_holds_those_that_nothing_beats():
    points = [Point("a", 1.0, 5.0), Point("b", 2.0, 6.0), Point("c", 3.0, 1.0), Point("d", 3.0, 2.0)]
    assert [p.method for p in front(points)] == ["a", "c"]


def test_points_need_every_scene():
    run = run_of(all_rows())
    everywhere = points_of(run, run.cells("speed"), "gap/energy")
    assert [p.method for p in everywhere] == ["simulation", "newton-1", "newton-4"]
    cells = run.cells("speed")
    worn = points_of(run, cells[cells["scene"] != "sheet"], "gap/energy")
    of_solvers = {"simulation", "newton-1", "newton-4", "lbfgs-5", "lbfgs-20"}
    assert {p.method for p in solvers(run, worn)} == of_solvers


@pytest.mark.parametrize(
    ("repeats", "spread"), [((), 2.0 * 2.0**0.5), ((5.0,), 2.0 * 2.0**0.5), ((200.0,), 4.0)]
)
def test_a_run_time_spreads_as_its_seeds_or_as_its_repeats_where_that_is_more(repeats, spread):
    rows = [row(SCENES[0], "newton-1", m, v) for m, v in (("cost/frame", 10.0), ("gap/energy", 0.2))]
    rows += [row(SCENES[0], "snug", "cost/spread", x, seed=s) for x in repeats for s in (0, 1)]
    rows += [
        row(SCENES[0], "snug", metric, value, seed=seed)
        for seed, time in ((0, 1.0), (1, 3.0))
        for metric, value in (("cost/frame", time), ("gap/energy", 0.1))
    ]
    run = run_of(rows)
    points = points_of(run, run.cells("speed"), "gap/energy")
    spreads = {p.method: p.time_spread for p in points}
    assert spreads == {"newton-1": 0.0, "snug": pytest.approx(spread)}


def test_a_point_is_of_the_seeds_that_did_every_scene():
    rows = [
        row(scene, "snug", metric, value, seed=seed)
        for seed, values in ((0, (1.0, 3.0)), (1, (9.0, None)))
        for scene, value in zip(SCENES, values)
        for metric in ("cost/frame", "gap/energy")
        if value is not None
    ]
    gone = {"seed": 1, "status": "diverged", "reason": "no end"}
    rows.append(row(SCENES[1], "snug", "cost/frame", None, **gone))
    (point,) = points_of(run_of(rows), run_of(rows).frame, "gap/energy")
    assert (point.time, point.error) == (2.0, 2.0)


def test_an_error_cannot_be_told_apart_below_that_of_the_references_other_start():
    def band(**changed):
        rows = [
            row(scene, member, "distance/rms", value, "mm", **(changed if scene == SCENES[1] else {}))
            for scene, value in zip(SCENES, (3.0, 5.0))
            for member in ("simulation-perturbed-1e-4", "simulation-dt/8")
        ]
        return noise_floor(run_of(rows), run_of(rows).frame, "distance/rms")

    assert band() == pytest.approx(4.0)
    assert band(status="stalled", reason="a frame") == pytest.approx(3.0)  # takes no part


def test_run_time_is_from_pose_to_vertices_where_every_timed_cell_has_that():
    rows = all_rows()
    frame_times = [r for r in rows if r.metric == "cost/frame"]
    whole = [dataclasses.replace(r, metric="cost/whole", value=r.value + 2.0) for r in frame_times]
    rows.append(row(SCENES[0], "skinning", "cost/spread", 50.0, "%"))
    for added, shift in ((whole, 2.0), (whole[1:], 0.0)):
        run = run_of([*rows, *added])
        cells = run.cells("speed")
        scene = cells[cells["scene"] == SCENES[0]]
        points = points_of(run, scene, "gap/energy")
        (point,) = (p for p in points if p.method == "skinning")
        assert point.time == pytest.approx(0.1 + shift) and point.time_spread == pytest.approx(0.05)
        assert run_time(scene) == ("cost/whole" if shift else "cost/frame")


def test_rivals_are_the_fastest_solvers_as_accurate():
    run = run_of(all_rows())
    rows = run.cells("speed")
    assert rivals(run, rows[rows["scene"].isin(SCENES)]) == ["simulation", "lbfgs-20", "lbfgs-5"]
