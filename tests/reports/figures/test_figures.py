"""Figures of the report and what they are read from."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from benchmarks.results.run_folder import RunFolder
from reports import build
from reports.figures import figures, hem, shapes, stability, styles, training, work_precision
from reports.figures.plotting import file_name, printable
from reports.pictures import chosen_roll_outs as roll_outs
from reports.pictures import render
from reports.pictures import sheets as pictures
from reports.run.finished_run import shown_seeds
from reports.statistics.pareto import Point
from tests.reports.report_folder import FRAMES, mesh, row, run_of, sheet, write_model


def test_points_at_or_below_the_simulation_are_on_the_edge_not_lost():
    from reports.figures.plotting import new_figure

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


def filmed(tmp_path, methods, height=0.1):
    cloth, faces = sheet(height)
    inertia = {"energy/inertia": np.array([0.0, 0.0, 1.0, 5.0, 2.0])}
    series = {
        method: mesh(cloth[:frames], faces, {name: values[:frames] for name, values in inertia.items()})
        for method, frames in methods.items()
    }
    return pictures.Filmed("tshirt/a", series, mesh(*sheet(0.0), {}))


def test_what_ended_early_moves_nobody_elses_picture(tmp_path):
    shown = filmed(tmp_path, {"simulation": FRAMES, "snug": FRAMES, "lbfgs-5": 2})
    run = run_of([row(method=method) for method in shown.series])
    picture = pictures.side_by_side(tmp_path, run, shown, ["simulation", "snug"])
    assert "frame 3 " in picture.caption
    assert "Not shown, for they ended before it: L-BFGS, 5 iterations." in picture.caption
    whole = filmed(tmp_path, {"simulation": FRAMES, "snug": FRAMES, "lbfgs-5": FRAMES})
    picture = pictures.side_by_side(tmp_path, run, whole, ["simulation", "snug"])
    assert (
        "Not shown, for want of room: L-BFGS, 5 iterations." in picture.caption
        and "ended" not in picture.caption
    )


def test_the_frame_of_page_one_is_one_whose_step_was_judged(tmp_path):
    shown = filmed(tmp_path, {"simulation": FRAMES, "snug": FRAMES})
    for cloth in shown.series.values():
        cloth.frame_fields["step/vertices"] = np.zeros((FRAMES, 16))
        cloth.frame_fields["step/vertices"][3] = np.nan
    assert shown.chosen_frame(["simulation", "snug"], "simulation")[0] == 4
    shown.series["snug"].frame_fields["step/vertices"][4, :4] = 7.0
    scale = pictures.scales(shown, ["simulation", "snug"], 4, "simulation")["step"]
    assert scale.top == 7.0
    pale, dark = scale.colours("simulation")[0], scale.colours("snug")[0]
    assert dark.mean() < pale.mean() - 0.3  # told apart in grey


def test_a_view_shows_the_nearer_surface_and_what_lies_behind_around_it():
    cloth, faces = sheet(0.1)
    camera = render.camera_for([cloth[0]], 0.0, 1.0)
    body = render.Surface(cloth[0] * [1.0, 1.0, 0.0], faces, (0.0, 0.0, 1.0))
    front = render.Surface(cloth[0], faces, (1.0, 0.0, 0.0))
    image, other = render.views(
        body, [front, render.Surface(cloth[0] - [0, 0, 0.2], faces, (0, 1, 0))], camera, 60, 60
    )
    assert image.shape == (60, 60, 3) and image[0, 0].min() == 1.0  # white around
    assert image[30, 30, 0] > 0.3 > image[30, 30, 2] and other[30, 30, 2] > 0.3 > other[30, 30, 1]
    # A corner of the mesh comes to where the camera says that it is.
    x, y, _ = camera.seen(cloth[0])[0]
    column, line = int(30 + 60 * x / camera.height), int(30 - 60 * y / camera.height)
    assert image[line - 2, column + 2].max() < 1.0 or image[line - 2, column + 2, 2] < 0.9


def test_light_from_the_side_tells_a_fold_from_a_sheet():
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 61), np.linspace(1.0, 1.4, 41))
    corner = (np.arange(40)[:, None] * 61 + np.arange(60)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 62], 1), np.stack([corner, corner + 62, corner + 61], 1)]
    )

    def shades(depth: float) -> float:
        points = np.stack([x.ravel(), y.ravel(), depth * np.sin(40.0 * x.ravel())], axis=1)
        camera = render.camera_for([points], 0.0, 0.7)
        (image,) = render.views(None, [render.Surface(points, faces, render.CLOTH_COLOUR)], camera, 90, 63)
        return float(image[20:43, 20:70].mean(axis=2).std())

    assert shades(0.01) > 0.04 > 5.0 * shades(0.0)


def test_a_failure_is_shown_at_its_worst_frame(tmp_path):
    rows = [row("tshirt/a", m, "energy/strain", v) for m, v in (("simulation", 0.1), ("snug", 2.0))]
    folder, run = RunFolder(tmp_path), run_of(rows)
    cloth, faces = sheet(0.1)
    strain = {"energy/strain": np.array([0.0, 9.0, 1.0, 1.0, 1.0])}
    assert roll_outs._failures(folder, run, lambda path: None) == []
    (picture,) = roll_outs._failures(folder, run, lambda path: mesh(cloth, faces, strain))
    assert picture.path.is_file() and picture.kind == "failures"


def test_a_checkpoint_is_no_method(tmp_path, monkeypatch):
    folder = RunFolder(tmp_path)
    write_model(folder.models / "snug-seed0.safetensors", "snug", strain=0.1)
    write_model(folder.models / ".pbns-seed0.checkpoint.safetensors", "pbns", strain=0.1)
    run, read = run_of([row(), row(method="pbns")]), []
    monkeypatch.setattr(training, "read_history", lambda path, method: read.append(path))
    assert training.read_histories(folder, run, []) == []
    assert [path.name for path in read] == ["snug-seed0.safetensors"]


def test_every_garment_has_its_training_curves(tmp_path):
    folder = RunFolder(tmp_path)
    for garment in ("tshirt", "tunic"):
        write_model(folder.models_of(garment) / "snug-seed0.safetensors", "snug", strain=0.1)
    run = run_of([row(), row("tunic/stop")])
    histories = training.read_histories(folder, run, [])
    assert training.training_curves(folder.figures, run, []) == []
    pictures = training.training_curves(folder.figures, run, histories)
    assert [picture.path.name for picture in pictures] == ["training.svg", "training_tunic.svg"]
    assert [picture.caption.partition(":")[0] for picture in pictures] == ["tshirt", "tunic"]


def history(seed: int, end: float, count=50, best_step=float("nan")):
    """A loss of 4 that falls to `end` after four fifths of the steps; logged every 20."""
    losses = [4.0] * (4 * count // 5) + [end] * (count - 4 * count // 5)
    rows = [{"step": 20 * k, "seconds": 0.5 * k, "loss": loss} for k, loss in enumerate(losses, 1)]
    return training.History("snug", "J", rows, "tshirt", seed, frames=90, best_step=best_step)


def test_how_trainings_ended_is_a_mean_over_seeds():
    (made,) = training.trainings(run_of([row()]), [history(0, 3.0), history(1, 2.0)])
    ((garment, method, seeds, *numbers, unit),) = made.rows
    frames, steps, seconds, loss, decrease = numbers
    assert (garment, method, seeds, unit) == ("tshirt", "snug", 2, "J")
    assert (frames, steps, seconds, loss.value) == (90.0, 1000.0, 25.0, 2.5)
    # A quarter of 4, and half of it.
    assert decrease.value == 37.5 and decrease.spread == pytest.approx(12.5 * 2**0.5)
    assert decrease.complete and loss.complete
    (made,) = training.trainings(run_of([row()]), [history(0, 3.0), history(1, float("nan"))])
    assert made.rows[0][6].lacking == 1
    (made,) = training.trainings(run_of([row()]), [history(0, 3.0, best_step=20.0)])
    assert [column.name for column in made.columns][5] == "best" and made.rows[0][5] == 20.0
    assert np.isnan(history(0, 3.0, count=45).decrease)  # nine losses at its end are no ten
    (made,) = training.trainings(run_of([row()]), [history(0, 3.0, count=9)])
    assert "decrease" not in [column.name for column in made.columns]  # too few were logged


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
    from reports.tables.pivots import map_points, stress_tests

    assert set(map_points(run).values()) >= {(1.0, 1e-4), (1e4, 1 / 30)} and len(map_points(run)) == 10
    assert list(stress_tests(run)["scene"]) == ["another"]
    (picture,) = stability.stability_maps(tmp_path, run)
    assert picture.path.is_file() and picture.path.with_suffix(".png").is_file()
    assert stability.stability_maps(tmp_path, run_of([other], cases=cases)) == []
    blues = [stability.shade(n)[0] for n in (1.0, 2.0, 20.0, 300.0, 1e6)]
    assert blues == sorted(blues, reverse=True) and blues[0] == blues[1] and blues[3] == blues[4]


def drawn_by(monkeypatch, make, *given):
    """The figures that a function saves."""
    figures_, name = [], make.__module__
    monkeypatch.setattr(f"{name}.save", lambda figure, *_, **more: figures_.append(figure) or more["caption"])
    make(*given)
    return figures_


def test_a_dot_stands_for_each_motion_and_seed(tmp_path, monkeypatch):
    rows = [
        row(s, "snug", "energy/total", v, seed=k)
        for s in ("tshirt/a", "tshirt/b")
        for k, v in enumerate((1, 3))
    ]
    (figure,) = drawn_by(monkeypatch, figures.dots, tmp_path, run_of(rows))
    dots, bar = figure.axes[0].get_lines()
    assert sorted(dots.get_xdata()) == [1.0, 1.0, 3.0, 3.0] and list(bar.get_xdata()) == [2.0, 2.0]
    assert figures.dots(tmp_path, run_of([row("flag", garment="")])) == []


def test_errors_are_drawn_against_the_vertices_that_scenes_declare(tmp_path, monkeypatch):
    sizes = {"mesh/a": 500.0, "mesh/b": 2000.0}
    rows = [row(s, "simulation", "mesh/vertices", n, suite="validation", unit="1") for s, n in sizes.items()]
    rows += [row(s, "snug", "curvature/error", n / 100.0, unit="1/m") for s, n in sizes.items()]
    (figure,) = drawn_by(monkeypatch, figures.against_vertices, tmp_path, run_of(rows))
    (line,) = figure.axes[0].get_lines()
    assert list(line.get_xdata()) == [500.0, 2000.0] and list(line.get_ydata()) == [5.0, 20.0]
    assert figures.against_vertices(tmp_path, run_of(rows[2:])) == []
    # The same mesh with more steps, and a sheet, are other scenes.
    rows += [
        row("dt/b", "simulation", "mesh/vertices", 2000.0, unit="1"),
        row("dt/b", metric="curvature/error"),
    ]
    rows += [row("dt/b", "simulation", "mesh/steps", 4.0, unit="1")]
    rows += [row("drape", "simulation", "mesh/vertices", 900.0, unit="1")]
    rows += [row("drape", metric="curvature/error")]
    (figure,) = drawn_by(monkeypatch, figures.against_vertices, tmp_path, run_of(rows))
    assert list(figure.axes[0].get_lines()[0].get_ydata()) == [5.0, 20.0]


def test_the_first_seed_that_came_to_its_end_is_shown():
    bad = [row(value=None, status="diverged", reason="no end", method=m) for m in ("snug", "pbns")]
    rows = [*bad, row(seed=2), row(seed=1), row(method="skinning")]
    seeds = shown_seeds(run_of(rows).frame).loc["tshirt/walk"]
    assert seeds.to_dict() == {"snug": 1, "pbns": 0, "skinning": 0}


def test_names_in_any_letters_give_files_that_the_report_finds():
    assert (
        file_name("tshirt/跳跃@clip")
        == "tshirt-U-8DF3U-8DC3-clip"
        == file_name(printable("tshirt/跳跃@clip"))
    )


def shaped(method, metric, values, **more):
    rows = [row(f"shapes/{place}", method, metric, value, suite="shapes", garment="tshirt", **more)
            for place, value in enumerate(values)]  # fmt: skip
    return rows


def test_energies_are_drawn_and_listed_against_the_shape(tmp_path, monkeypatch):
    rows = shaped("simulation", "body/shape", (0.0, 6.0, 4.0), unit="1")
    rows += shaped("simulation", "energy/total", (0.3, 0.5, 0.4))
    twin = {"family": "simulation-perturbed", "level": 1e-6}
    rows += shaped("simulation-perturbed-1e-6", "energy/total", (0.3, 0.5, 0.4), **twin)
    rows += shaped("snug", "energy/total", (0.35, 0.8, 0.6)) + shaped(
        "snug", "energy/strain", (0.1, 0.4, 0.2)
    )
    (figure,) = drawn_by(monkeypatch, shapes.against_shape, tmp_path, run_of(rows))
    lines = [tuple(line.get_ydata()) for line in figure.axes[0].get_lines()]
    assert lines == [pytest.approx((0.05, 0.2, 0.3))] and len(figure.axes) == 2  # above the simulation
    assert figure.axes[0].get_ylabel().startswith("Total above the simulation")
    labels = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert all(list(line.get_xdata()) == [0, 1, 2] for line in figure.axes[0].get_lines())
    assert [float(label) for label in labels] == [0.0, 4.0, 6.0]

    together, each = shapes.shapes(run_of(rows))
    names = [column.name for column in together.columns]
    assert names == ["scene", "shape", "method", "above", "energy/total", "energy/strain"]
    assert len(each.rows) == 6 and set(together.rows[2:]) <= set(each.rows)
    found = {(line[0], line[2]): line for line in (*together.rows, *each.rows)}
    assert list(found)[:4] == [(s, m) for s in ("other shapes", "shapes/0") for m in ("simulation", "snug")]
    together = found["other shapes", "snug"]
    assert together[3] == pytest.approx(0.7 - 0.45) and together[4].value == pytest.approx(0.7)
    assert found["shapes/2", "snug"][1] == 4.0 and found["shapes/2", "snug"][3] == pytest.approx(0.2)
    assert found["shapes/2", "simulation"][3] is None and found["shapes/2", "simulation"][5] is None

    said = "Total energy above the simulation's on 2 other bodies [J]: SNUG 0.250."
    assert shapes.on_other_bodies(run_of(rows)) == said
    # A method that failed on a body is compared on the others, and the sentence says so.
    last = [row("shapes/1", "snug", "cost/frame", None, suite="shapes", status="diverged", reason="no end")]
    kept = [r for r in rows if (r.scene, r.method) != ("shapes/1", "snug")]
    said = "Total energy above the simulation's on 2 other bodies [J]: SNUG 0.200 (1 of 2 roll-outs)."
    assert shapes.on_other_bodies(run_of(kept + last)) == said
    one = [r for r in rows if r.scene == "shapes/0"]
    assert shapes.on_other_bodies(run_of(one)) == ""
    assert shapes.shapes(run_of(one)) == shapes.against_shape(tmp_path, run_of(one)) == []


def test_histograms_hold_every_vertex_once(tmp_path, monkeypatch):
    cloth, faces = sheet(0.1)
    run = run_of([row(method="simulation")])
    areas = np.full(len(faces), 0.5 * (0.4 / 3) * (0.5 / 3))
    (figure,) = drawn_by(
        monkeypatch,
        figures.histograms,
        tmp_path,
        run,
        "tshirt/a",
        {"simulation": mesh(cloth, faces, {})},
        areas,
    )
    shares = [line.get_ydata() for axes in figure.axes for line in axes.get_lines()]
    assert len(shares) == 2 and all(np.isclose(own[own > figures.RARE].sum(), 100.0) for own in shares)


def test_checks_are_drawn_by_their_tolerances_in_order(tmp_path, monkeypatch):
    more = {
        "suite": "validation",
        "method": "simulation",
        "metric": "check",
        "expected": 0.0,
        "tolerance": 2.0,
    }
    rows = [row(f"case {k}", value=v, **more) for k, v in enumerate((1.0, 0.5, 0.0))]
    (figure,) = drawn_by(monkeypatch, figures.known_answers, tmp_path, run_of(rows))
    assert list(figure.axes[0].get_lines()[0].get_ydata()) == [figures.LEAST, 0.25, 0.5]


def test_only_what_was_drawn_is_read(tmp_path):
    """A scene of another kind, such as a roll-out of a thousand frames, has no pictures of its frames."""
    run = run_of([row("tshirt/there_and_back", metric="roll_out/drift", unit="mm")])
    folder, problems = RunFolder(tmp_path), []
    path = folder.trajectory_path("tshirt/there_and_back", "snug")
    path.parent.mkdir(parents=True)
    path.write_bytes(b"no mesh")
    read = lambda path: build.read_trajectory(folder, path, problems)  # noqa: E731
    assert roll_outs.draw_roll_outs(folder, run, read) == [] and problems == []


def test_words_beside_a_row_have_room_for_all_their_lines():
    tile = np.zeros((10, 10, 3))
    figure = pictures.sheet([[tile]], (1.0, 1.0), ["0 s"], beside=["SNUG, paper's\ntext"])
    (words,) = (text for text in figure.texts if text.get_rotation() == 90)
    box = words.get_window_extent(FigureCanvasAgg(figure).get_renderer())
    assert box.x0 >= 0.0 and box.x1 <= figure.axes[0].get_window_extent().x0
