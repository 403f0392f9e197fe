"""Figures of the report and what they are read from."""

from __future__ import annotations

import numpy as np
from report_folder import FRAMES, row, sheet, write_mesh, write_model

from reference_sim import Trajectory
from reports import figures, hem, palette, render, training, vtkhdf, work_precision
from reports.fronts import Point


def test_the_reader_knows_the_simulators_files(tmp_path):
    positions = np.random.default_rng(0).normal(size=(3, 4, 3))
    fields = {"energy/strain": np.array([0.0, 1.0, 2.0])}
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    times = np.arange(3) / 30.0
    Trajectory(positions, faces, times, np.zeros(3), frame_fields=fields).save(tmp_path / "t.vtkhdf")
    series = vtkhdf.read_series(tmp_path / "t.vtkhdf")
    assert np.array_equal(series.positions(1), positions[1]) and np.array_equal(series.faces, faces)
    assert np.array_equal(series.positions(-1), positions[2]) and np.allclose(series.times, times)
    assert np.array_equal(series.fields["energy/strain"], fields["energy/strain"])


def test_points_at_or_below_the_simulation_are_on_the_edge_not_lost():
    from reports.canvas import new_figure

    axes = new_figure(3, 3).subplots()
    points = [Point("snug", 1.0, 0.2), Point("newton-8", 9.0, -0.1)]
    hollow = work_precision._draw_points(axes, points, 20.0, floor=0.0)
    assert hollow == {"newton-8"}
    low, high = axes.get_ylim()
    shown = [
        y for line in axes.get_lines() for y in np.atleast_1d(line.get_ydata()) if len(line.get_xdata()) == 1
    ]
    assert len(shown) >= 2 and all(low < y < high for y in shown[:2])


def test_a_check_that_must_be_exact_is_on_an_edge():
    exact = row("modes", "simulation", "check", 6.0, suite="validation", expected=6.0, tolerance=0.0)
    off = row("modes", "simulation", "check", 7.0, suite="validation", expected=6.0, tolerance=0.0)
    assert figures._tolerances_away(exact) == 0.0 and figures._tolerances_away(off) == float("inf")


def test_methods_keep_their_order_and_their_look():
    names = ["zebra", "newton-8", "snug", "newton-2", "simulation", "newton-16", "skinning"]
    known = ["simulation", "skinning", "snug", "newton-2", "newton-8", "newton-16", "zebra"]
    assert palette.ordered(names) == known
    assert palette.label("newton-1") == "Newton, 1 iteration"
    assert palette.style("newton-2").colour == palette.style("newton-16").colour
    colours = [palette.style(name).colour for name in palette._KNOWN]
    assert len(set(colours)) == len(colours)


def test_the_hem_is_drawn_where_it_swings(tmp_path):
    turn = {
        "hem/yaw": np.radians(np.linspace(0.0, 40.0, FRAMES)),
        "hem/from_end": np.linspace(0.1, 0.0, FRAMES),
    }
    series = {}
    for method in ("simulation", "snug"):
        cloth, faces = sheet(0.1)
        write_mesh(tmp_path / f"{method}.vtkhdf", cloth, faces, turn)
        series[method] = vtkhdf.read_series(tmp_path / f"{method}.vtkhdf")
    picture = hem.hem_curves(tmp_path, "tunic/twist", series)
    assert picture is not None and picture.path.is_file()
    write_mesh(tmp_path / "still.vtkhdf", cloth, faces, {name: 0.01 * curve for name, curve in turn.items()})
    assert (
        hem.hem_curves(tmp_path, "tunic/still", {"snug": vtkhdf.read_series(tmp_path / "still.vtkhdf")})
        is None
    )


def test_a_stop_is_where_the_body_no_longer_moves(tmp_path):
    cloth, faces = sheet(0.1)
    frames = 40
    moving = np.repeat(cloth[:1], frames, axis=0)
    moving[:12] += 0.01 * np.arange(12, 0, -1)[:, None, None]
    write_mesh(tmp_path / "body.vtkhdf", moving, faces, {})
    body = vtkhdf.read_series(tmp_path / "body.vtkhdf")
    assert hem.stop_frame(body) == 12
    short = moving[: 12 + hem.HELD]
    write_mesh(tmp_path / "short.vtkhdf", short, faces, {})
    assert hem.stop_frame(vtkhdf.read_series(tmp_path / "short.vtkhdf")) is None
    after = np.arange(frames) - 12.0
    curves = {
        "swings": np.radians(30.0 * np.exp(-0.1 * np.maximum(after, 0)) * np.cos(0.4 * after)),
        "creeps": np.radians(30.0 * np.exp(-0.3 * np.maximum(after, 0))),
    }
    series = {}
    for method, yaw in curves.items():
        path = tmp_path / f"{method}.vtkhdf"
        write_mesh(path, moving, faces, {"hem/yaw": yaw, "hem/from_end": np.abs(yaw - yaw[-1])})
        series[method] = vtkhdf.read_series(path)
    torn = {"hem/yaw": curves["swings"][:8], "hem/from_end": np.abs(curves["swings"][:8])}
    write_mesh(tmp_path / "torn.vtkhdf", moving[:8], faces, torn)  # it has no end to be measured from
    series["torn"] = vtkhdf.read_series(tmp_path / "torn.vtkhdf")
    picture = hem.hem_curves(tmp_path, "tunic/stop", series, body)
    assert picture is not None and "torn" not in picture.caption.lower()
    assert picture is not None and "the body has stopped, at 0.400 s" in picture.caption
    assert hem.overshoot(curves["swings"], 12) > np.radians(10.0)
    assert hem.overshoot(curves["creeps"], 12) == 0.0


def test_what_ended_early_moves_nobody_elses_picture(tmp_path):
    cloth, faces = sheet(0.1)
    inertia = {"energy/inertia": np.array([0.0, 0.0, 1.0, 5.0, 2.0])}
    series = {}
    for method, frames in (("simulation", FRAMES), ("snug", FRAMES), ("lbfgs-5", 2)):
        fields = {name: values[:frames] for name, values in inertia.items()}
        write_mesh(tmp_path / f"{method}.vtkhdf", cloth[:frames], faces, fields)
        series[method] = vtkhdf.read_series(tmp_path / f"{method}.vtkhdf")
    (picture,) = render.side_by_side(tmp_path, [render.Dressed("dressed/a", series, None)], opengl=False)
    assert "frame 3 " in picture.caption
    assert "Not shown, for they ended before their last frame: L-BFGS, 5 iterations." in picture.caption


def test_a_checkpoint_is_no_method(tmp_path, monkeypatch):
    write_model(tmp_path / "snug-seed0.safetensors", "snug", strain=0.1)
    write_model(tmp_path / ".pbns-seed0.0123.checkpoint.safetensors", "pbns", strain=0.1)
    monkeypatch.setattr(training, "_draw", lambda folder, panels: panels)
    ((_, histories),) = training.training_curves(tmp_path, tmp_path, [])[0]
    assert [history.method for history in histories] == ["snug"]
