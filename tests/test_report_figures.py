"""Figures of the report and what they are read from."""

from __future__ import annotations

import numpy as np
from report_folder import FRAMES, mesh, row, run_of, sheet, write_model

from benchmarks.results import RunFolder
from reports import build, figures, hem, render, stability, styles, training, work_precision
from reports.pareto import Point


def test_points_at_or_below_the_simulation_are_on_the_edge_not_lost():
    from reports.plotting import new_figure

    axes = new_figure(3, 3).subplots()
    run = run_of([row(method=method) for method in ("snug", "newton-8")])
    points = [Point("snug", 1.0, 0.2), Point("newton-8", 9.0, -0.1)]
    hollow = work_precision._draw_points(axes, run, points, 20.0, band=0.0)
    assert hollow == {"newton-8"}
    low, high = axes.get_ylim()
    shown = [
        y for line in axes.get_lines() for y in np.atleast_1d(line.get_ydata()) if len(line.get_xdata()) == 1
    ]
    assert len(shown) >= 2 and all(low < y < high for y in shown[:2])


def test_methods_keep_their_order_and_their_look():
    names = ["zebra", "newton-8", "snug", "newton-2", "simulation", "newton-16", "skinning"]
    run = run_of([row(method=name) for name in names])
    known = ["simulation", "skinning", "snug", "zebra", "newton-2", "newton-8", "newton-16"]
    assert run.ordered(names) == known
    assert styles.style(run, "newton-2").label == "Newton, 2 iterations"
    assert styles.style(run, "newton-2").colour == styles.style(run, "newton-16").colour
    assert styles.style(run, "newton-2").line != styles.style(run, "newton-8").line
    assert styles.style(run, "zebra") == styles.style(run_of([row(method="zebra")]), "zebra")
    colours = [look.colour for look in styles.KNOWN.values() if look.colour]
    assert len(set(colours)) == len(colours)


def test_what_starts_from_a_method_has_its_colour_and_an_ablation_its_marker():
    run = run_of([row(method=m) for m in ("snug", "snug+lbfgs-4", "snug-no-inertia", "snug+cleanup")])
    own, less, warm, cleaned = (
        styles.style(run, m) for m in ("snug", "snug-no-inertia", "snug+lbfgs-4", "snug+cleanup")
    )
    assert warm.colour == cleaned.colour == own.colour != less.colour
    assert less.marker == own.marker and warm.marker != own.marker
    family = styles.family_style(run, run.methods["snug+lbfgs-4"])
    assert (family.label, warm.label) == ("SNUG + L-BFGS", "SNUG + L-BFGS, 4 iterations")
    alone = run_of([row(method="snug+cleanup")])  # what it starts from did not run
    assert styles.style(alone, "snug+cleanup").label == "SNUG, cleaned up"


def test_the_hem_is_drawn_where_it_swings(tmp_path):
    turn = {
        "hem/yaw": np.radians(np.linspace(0.0, 40.0, FRAMES)),
        "hem/from_end": np.linspace(0.1, 0.0, FRAMES),
    }
    run = run_of([row(method=method) for method in ("simulation", "snug")])
    cloth, faces = sheet(0.1)
    series = {method: mesh(cloth, faces, turn) for method in run.methods}
    picture = hem.hem_curves(tmp_path, run, "tunic/twist", series)
    assert picture is not None and picture.path.is_file()
    still = mesh(cloth, faces, {name: 0.01 * curve for name, curve in turn.items()})
    assert hem.hem_curves(tmp_path, run, "tunic/still", {"snug": still}) is None


def test_a_stop_is_where_the_body_no_longer_moves(tmp_path):
    cloth, faces = sheet(0.1)
    frames = 40
    moving = np.repeat(cloth[:1], frames, axis=0)
    moving[:12] += 0.01 * np.arange(12, 0, -1)[:, None, None]
    body = mesh(moving, faces, {})
    assert hem.stop_frame(body) == 12
    assert hem.stop_frame(mesh(moving[: 12 + hem.HELD], faces, {})) is None
    assert hem.stop_frame(mesh(moving[12:], faces, {})) is None  # it never moved
    after = np.arange(frames) - 12.0
    curves = {
        "swings": np.radians(30.0 * np.exp(-0.1 * np.maximum(after, 0)) * np.cos(0.4 * after)),
        "creeps": np.radians(30.0 * np.exp(-0.3 * np.maximum(after, 0))),
    }
    series = {
        method: mesh(moving, faces, {"hem/yaw": yaw, "hem/from_end": np.abs(yaw - yaw[-1])})
        for method, yaw in curves.items()
    }
    torn = {"hem/yaw": curves["swings"][:8], "hem/from_end": np.abs(curves["swings"][:8])}
    series["torn"] = mesh(moving[:8], faces, torn)  # it has no end to be measured from
    run = run_of([row(method=method) for method in series])
    picture = hem.hem_curves(tmp_path, run, "tunic/stop", series, body)
    assert picture is not None and "torn" not in picture.caption.lower()
    assert "the body has stopped, at 0.400 s" in picture.caption
    assert hem.overshoot(curves["swings"], 12) > np.radians(10.0)
    assert hem.overshoot(curves["creeps"], 12) == 0.0


def test_what_ended_early_moves_nobody_elses_picture(tmp_path):
    cloth, faces = sheet(0.1)
    inertia = {"energy/inertia": np.array([0.0, 0.0, 1.0, 5.0, 2.0])}
    series = {}
    for method, frames in (("simulation", FRAMES), ("snug", FRAMES), ("lbfgs-5", 2)):
        fields = {name: values[:frames] for name, values in inertia.items()}
        series[method] = mesh(cloth[:frames], faces, fields)
    run = run_of([row(method=method) for method in series])
    picture = render.side_by_side(tmp_path, run, "tshirt/a", series, None)
    assert "frame 3 " in picture.caption
    assert "Not shown, for they ended before their last frame: L-BFGS, 5 iterations." in picture.caption


def test_a_checkpoint_is_no_method(tmp_path, monkeypatch):
    folder = RunFolder(tmp_path)
    write_model(folder.models / "snug-seed0.safetensors", "snug", strain=0.1)
    write_model(folder.models / ".pbns-seed0.checkpoint.safetensors", "pbns", strain=0.1)
    run, read = run_of([row(), row(method="pbns")]), []
    monkeypatch.setattr(training, "read_history", lambda path, method: read.append(path))
    assert training.training_curves(folder, run, []) == []
    assert [path.name for path in read] == ["snug-seed0.safetensors"]


def test_every_garment_has_its_training_curves(tmp_path):
    folder = RunFolder(tmp_path)
    for garment in ("tshirt", "tunic"):
        write_model(folder.models_of(garment) / "snug-seed0.safetensors", "snug", strain=0.1)
    run = run_of([row(), row("tunic/stop")])
    pictures = training.training_curves(folder, run, [])
    assert [picture.path.name for picture in pictures] == ["training.svg", "training_tunic.svg"]
    assert [picture.caption.partition(":")[0] for picture in pictures] == ["tshirt", "tunic"]


def point(stiffness: float, dt: float, status="ok"):
    more = {"suite": "extremes", "metric": "map", "unit": "iterations", "status": status}
    value = 3.0 if status == "ok" else None
    return row("map_sheet", "simulation", value=value, **{**more, "metric": f"map/{stiffness:g}/{dt:.3g}"})


def test_a_map_of_every_outcome_is_drawn_from_what_its_cases_declare(tmp_path):
    statuses = ("ok", "stalled", "failed", "timeout", "diverged")
    rows, cases = [], {}
    for k, status in enumerate(statuses):
        for dt in (1e-4, 1 / 30):
            rows.append(point(10.0**k, dt, status))
            cases[f"case {len(rows)}"] = {
                "suite": "extremes", "scene": "map_sheet", "metric": rows[-1].metric,
                "map_point": [10.0**k, dt],
            }  # fmt: skip
    other = row("another", "simulation", "outcome", 1.0, suite="extremes")
    cases["another"] = {"suite": "extremes", "map_point": None}
    run = run_of([*rows, other], cases=cases)
    from reports.tables import map_points, stress_tests

    assert set(map_points(run).values()) >= {(1.0, 1e-4), (1e4, 1 / 30)} and len(map_points(run)) == 10
    assert list(stress_tests(run)["scene"]) == ["another"]
    (picture,) = stability.stability_maps(tmp_path, run)
    assert picture.path.is_file() and picture.path.with_suffix(".png").is_file()
    assert stability.stability_maps(tmp_path, run_of([other], cases=cases)) == []
    blues = [stability.shade(n)[0] for n in (1.0, 2.0, 20.0, 300.0, 1e6)]
    assert blues == sorted(blues, reverse=True) and blues[0] == blues[1] and blues[3] == blues[4]


def test_throughput_is_of_the_scenes_that_were_measured_both_ways(tmp_path, monkeypatch):
    cost = {"unit": "ms", "method": "snug"}
    rows = [row(metric="cost/frame", value=0.5, **cost), row(metric="cost/batch", value=0.1, **cost)]
    rows += [row("tshirt/jump", metric="cost/frame", value=9.0, **cost)]
    rows += [row(metric="cost/frame", value=70.0, unit="ms", method="simulation")]
    ablation = {"unit": "ms", "method": "snug-springs"}
    rows += [row(metric="cost/frame", **ablation), row(metric="cost/batch", **ablation)]
    drawn = []
    monkeypatch.setattr(figures, "save", lambda figure, *_, **more: drawn.append(figure) or more["caption"])
    assert figures.throughput(tmp_path, run_of(rows))[0].startswith("tshirt: frames per second")
    (axes,) = drawn.pop().axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["SNUG"]
    assert [list(line.get_xdata()) for line in axes.get_lines()] == [[2000.0, 10000.0], [2000.0], [10000.0]]
    figures.throughput(tmp_path, run_of(rows[-2:]))  # without its base the ablation stands for itself
    assert [label.get_text() for label in drawn.pop().axes[0].get_yticklabels()] == ["SNUG, springs"]
    assert figures.throughput(tmp_path, run_of(rows[3:4])) == []


def test_only_what_was_drawn_is_read(tmp_path):
    """A scene of another kind, such as a roll-out of a thousand frames, has no pictures of its frames."""
    run = run_of([row("tshirt/there_and_back", metric="roll_out/drift", unit="mm")])
    folder, problems = RunFolder(tmp_path), []
    path = folder.trajectory_path("tshirt/there_and_back", "snug")
    path.parent.mkdir(parents=True)
    path.write_bytes(b"no mesh")
    assert build.draw_trajectories(folder, run, problems) == [] and problems == []
