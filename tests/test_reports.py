"""The report of a run: numbers as they are, dashes where there are none, the same bytes twice."""

from __future__ import annotations

import csv
import json
import re
import struct
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from benchmarks.results import Row, RunFolder
from reference_sim import Trajectory
from reports import (
    build,
    figures,
    hem,
    numbers,
    palette,
    render,
    tables,
    training,
    vtkhdf,
    words,
    work_precision,
)
from reports.document import document, merged
from reports.fronts import Point
from reports.layout import table_block
from reports.summary import Mean, Measurements

TERMS = {"strain": 0.1, "bending": 0.01, "gravity": 0.3, "inertia": 0.004, "collision": 0.02}
METHODS = {"simulation": 1.0, "skinning": 9.0, "snug": 2.0, "pbns": 3.0}
SCENES = ("dressed/walk", "dressed/jump")
FRAMES = 5


def row(scene="dressed/walk", method="snug", metric="energy/strain", value=1.0, *, seed=0, **more) -> Row:
    more = {"suite": "garments", "unit": "J", **more}
    return Row(scene=scene, method=method, seed=seed, metric=metric, value=value, **more)


def skipped(reason="no body here", **more) -> Row:
    return row(value=None, status="skipped", reason=reason, **more)


def write_mesh(path: Path, positions: np.ndarray, faces: np.ndarray, fields: dict[str, np.ndarray]) -> None:
    """A trajectory file with what the report reads of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        file["VTKHDF/Points"] = positions.reshape(-1, 3)
        file["VTKHDF/NumberOfPoints"] = [positions.shape[1]]
        file["VTKHDF/Polygons/Connectivity"] = faces.ravel()
        file["VTKHDF/Steps/Values"] = np.arange(len(positions)) / 30.0
        own = file.create_group("benchmark")
        own.attrs["frames"] = len(positions)
        own.create_group("frame_fields")
        for name, values in fields.items():
            own["frame_fields"][name.replace("/", ":")] = values


def sheet(height: float) -> tuple[np.ndarray, np.ndarray]:
    """A 4 x 4 sheet in the xy plane at z = height, (T,V,3) and (F,3)."""
    x, y = np.meshgrid(np.linspace(0, 0.4, 4), np.linspace(1.0, 1.5, 4))
    points = np.stack([x.ravel(), y.ravel(), np.full(16, height)], axis=1)
    corner = (np.arange(3)[:, None] * 4 + np.arange(3)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 5], 1), np.stack([corner, corner + 5, corner + 4], 1)]
    )
    return np.repeat(points[None], FRAMES, axis=0), faces


def write_model(path: Path, kind: str, **last: float) -> None:
    """The header of a safetensors file, with a short history."""
    history = [{"step": s, "seconds": 0.1 * s, "loss": 2.0 / s, **last} for s in (1, 2, 4)]
    header = json.dumps({"__metadata__": {"snug": json.dumps({"kind": kind, "history": history})}}).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(struct.pack("<Q", len(header)) + header)


def all_rows() -> list[Row]:
    """Two dressed scenes, a cut solver, a scene without a body, checks and extreme cases."""
    rows = []
    for number, scene in enumerate(SCENES):
        for method, factor in METHODS.items():
            for term, value in TERMS.items():
                rows.append(row(scene, method, f"energy/{term}", factor * value * (1 + number)))
            rows.append(row(scene, method, "energy/total", factor * (1 + number)))
            rows.append(row(scene, method, "cost/frame", 10.0 / factor, unit="ms"))
            if method != "simulation":
                rows.append(row(scene, method, "curvature/error", factor, unit="1/m"))
        for metric in ("energy/strain", "cost/frame"):
            failed = {"value": None, "status": "failed", "reason": "diverged at step 7"}
            rows.append(row(scene, "supervised", metric, **failed))
    for cut in (1, 4):
        more = {"suite": "speed", "method": f"newton-{cut}"}
        rows.append(row(SCENES[0], metric="cost/frame", unit="ms", value=2.0 * cut, **more))
        rows.append(row(SCENES[0], metric="curvature/error", unit="1/m", value=3.0 / cut, **more))
        rows.append(row(SCENES[0], metric="energy/total", value=1.5 - cut * 0.2, **more))
        rows.append(row("hanging_sheet", metric="energy/strain", value=0.0, **more))
    rows.append(row("free_fall", "simulation", "energy/gravity", -0.5, suite="speed"))
    rows.append(skipped(scene="hanging_sheet", suite="speed"))
    check = {"suite": "validation", "method": "simulation", "metric": "check", "unit": "m"}
    rows.append(row("free_fall", value=1e-15, expected=0.0, tolerance=1e-12, **check))
    rows.append(row("zero_modes", value=6.0, expected=6.0, tolerance=0.0, **check))
    more = {"status": "failed", "reason": "off", "expected": 0.28350664, "tolerance": 1e-4}
    rows.append(row("sag", value=0.3, **check, **more))
    case = {"suite": "extremes", "method": "simulation", "metric": "outcome", "unit": "vertex weights"}
    rows.append(row("stiff", value=3e-7, **case))
    rows.append(row("teleport", value=None, status="timeout", reason="over 30 s", **case))
    return rows


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> RunFolder:
    """A whole run folder with its report, drawn without OpenGL."""
    run = RunFolder(tmp_path_factory.mktemp("run"))
    run.write_rows(all_rows())
    run.write_config({"preset": "smoke", "commit": "abc", "finished": "2030-01-02T03:04:05+00:00"})
    for scene in SCENES:
        body, faces = sheet(0.0)
        write_mesh(run.trajectory_path(scene, "body"), body, faces, {})
        for method in METHODS:
            cloth, faces = sheet(0.1)
            fields = {f"energy/{t}": np.linspace(0, v, FRAMES) for t, v in TERMS.items()}
            write_mesh(run.trajectory_path(scene, method), cloth, faces, fields)
    write_model(run.models / "snug-seed0.safetensors", "snug", strain=0.1)
    write_model(run.models / "supervised-seed0.safetensors", "supervised", vertices=2.0)
    assert build.main([str(run.path), "--no-opengl"]) == 0
    return run


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_table_1_is_the_mean_over_scenes(made):
    lines = {line["method"]: line for line in read_csv(made.tables / "energies.csv")}
    assert list(lines) == ["simulation", "skinning", "pbns", "snug"]
    for method, factor in METHODS.items():
        for term, value in TERMS.items():
            assert float(lines[method][f"{term} [J]"]) == pytest.approx(1.5 * factor * value, rel=1e-8)
        assert float(lines[method]["total [J]"]) == pytest.approx(1.5 * factor, rel=1e-8)


def test_what_is_not_declared_is_a_dash_and_zero_stays_zero(made):
    lines = read_csv(made.tables / "energies_by_scene.csv")
    sheet_line = next(x for x in lines if x["scene"] == "hanging_sheet" and x["method"] == "newton-1")
    assert sheet_line["strain [J]"] == "0"
    assert sheet_line["collision [J]"] == sheet_line["total [J]"] == "-"
    fall = next(x for x in lines if x["scene"] == "free_fall")
    assert fall["strain [J]"] == "-" and fall["gravity [J]"] == "-0.5"


def test_every_file_of_the_report_is_there(made):
    names = {path.name for path in made.tables.iterdir()}
    wanted = ("energies", "energies_by_scene", "curvature", "cost", "validation", "extremes", "unfinished")
    assert {f"{name}.csv" for name in wanted} <= names
    pictures = {path.name for path in made.figures.iterdir()}
    for stem in ("energy_series_dressed-walk", "error_against_time_dressed-walk", "validation_1", "training"):
        assert {f"{stem}.svg", f"{stem}.png"} <= pictures
    assert {"frames_dressed-walk.png", "frames_dressed-jump.png", "extremes_1.png"} <= pictures
    assert made.report_path.read_bytes().startswith(b"%PDF")


def test_the_papers_numbers_are_in_no_file_of_ours(made):
    for path in made.tables.iterdir():
        assert "paper" not in path.read_text(encoding="utf-8").lower()


def test_made_twice_it_is_the_same_to_the_byte(made):
    def contents() -> dict[str, bytes]:
        return {str(p): p.read_bytes() for p in sorted(made.path.rglob("*")) if p.is_file()}

    before = contents()
    assert build.main([str(made.path), "--no-opengl"]) == 0
    assert contents() == before


def test_failed_cells_are_listed_once_with_their_reason(made):
    lines = read_csv(made.tables / "unfinished.csv")
    found = [(x["scene"], x["method"], x["status"], x["reason"]) for x in lines]
    assert found == [
        ("dressed/walk", "supervised", "failed", "diverged at step 7"),
        ("dressed/jump", "supervised", "failed", "diverged at step 7"),
        ("hanging_sheet", "snug", "skipped", "no body here"),
    ]


def test_lines_that_differ_in_their_scene_alone_become_one():
    table = tables.unfinished([skipped(scene="a"), skipped(scene="b"), skipped(scene="c", reason="other")])
    assert table is not None
    assert [line[1] for line in merged(table, "scene").rows] == ["a, b", "c"]


def test_mean_and_spread_over_seeds():
    rows = [row(scene, seed=s, value=v) for scene in SCENES for s, v in ((0, 1.0), (1, 3.0), (2, 8.0))]
    mean = Measurements(rows).mean("snug", "energy/strain", SCENES)
    assert mean == Mean(4.0, pytest.approx(np.std([1, 3, 8], ddof=1)), scenes=2, seeds=3, complete=True)
    assert Measurements(rows[:1]).mean("snug", "energy/strain", SCENES[:1]).spread is None


def test_a_failed_cell_enters_no_mean_and_the_table_says_so():
    rows = [
        row("dressed/walk", value=1.0),
        row("dressed/jump", value=100.0, status="failed", reason="x"),
        row("dressed/walk", "simulation", value=4.0, status="stalled", reason="2 frames"),
        row("dressed/jump", "simulation", value=6.0),
    ]
    table = tables.energies(rows)
    assert table is not None
    lines = {line[0]: line[1] for line in table.rows}
    assert lines["snug"].value == 1.0 and not lines["snug"].complete
    assert lines["simulation"].value == 5.0 and lines["simulation"].complete and lines["simulation"].stalled
    block = table_block(table, "")
    assert [line[1]["mark"] for line in block["groups"][0]["rows"]] == ["†", "*"]
    assert "fewer scenes" in block["note"] and "unconverged" in block["note"]


def test_a_cell_of_two_suites_counts_once_in_its_own_table():
    rows = [row(value=v, metric="cost/frame", suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))]
    rows += [row(value=v, suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))]
    by_scene, speed = tables.energies_by_scene(rows), tables.speed(rows)
    assert by_scene is not None and speed is not None
    assert [line[2].value for line in by_scene.rows] == [1.0] and speed.rows[0][2].value == 2.0


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.064349, "0.0643"),
        (12.34, "12.3"),
        (1734.0, "1,734"),
        (-0.5, "−0.500"),
        (0.0, "0"),
        (9.996, "10.0"),
        (2.5e-7, "2.50×10⁻⁷"),
        (3.2e9, "3.20×10⁹"),
        (None, "–"),
        (float("nan"), "–"),
        (float("inf"), "–"),
    ],
)
def test_numbers_as_text(value, text):
    assert numbers.number(value) == text


def test_other_texts():
    assert numbers.number(0.2835, 7, trim=True) == "0.2835" and numbers.number(6.0, 7, trim=True) == "6"
    assert numbers.with_spread(0.5, 0.012) == "0.500 ± 0.012" and numbers.with_spread(0.5, None) == "0.500"
    assert [numbers.duration(s) for s in (0.0, 61.0, 402.0, 104400.0, None)] == [
        "0 s", "61.0 s", "6.70 min", "29.0 h", "–",
    ]  # fmt: skip
    assert numbers.csv_number(None) == "-" and numbers.csv_number(0.0) == "0"


def test_decimal_points_stand_in_a_column():
    padded = numbers.aligned(["0.123", "18.2", "400", "–"])
    assert len({len(text) - text.index(".") for text in padded[:2]}) == 1
    assert len(padded[2]) - 3 == len(padded[0]) - 1 and padded[3] == "–"


def test_the_answer_follows_the_numbers():
    def said(snug: float, pbns: float) -> str:
        values = (("snug", snug), ("pbns", pbns))
        terms = ("strain", "bending", "gravity", "inertia", "total")
        rows = [row(method=m, metric=f"energy/{t}", value=v) for m, v in values for t in terms]
        return " ".join(text for _, text in words.findings(rows))

    assert "SNUG has the lowest" in said(1.0, 2.5) and "inertia is reproduced." not in said(2.5, 1.0)
    assert "PBNS has the lowest" in said(2.5, 1.0) and "2.5 times as much" in said(2.5, 1.0)
    assert "SNUG is lower in strain" in said(1.0, 2.5) and "SNUG is higher in strain" in said(2.5, 1.0)
    assert "gravity and inertia, is reproduced." in said(1.0, 1.2)
    assert "equal in strain" in said(1.0, 1.001) and "reproduced in 0 of the 4" in said(1.0, 1.001)


def test_a_difference_within_the_spread_of_the_seeds_is_no_difference():
    rows = [row(seed=s, value=v) for s, v in ((0, 0.8), (1, 1.2))]
    rows += [row(method="pbns", seed=s, value=v) for s, v in ((0, 0.9), (1, 1.3))]
    measured = Measurements(rows)
    assert words.against(measured, "pbns").startswith("SNUG is equal in strain")


def test_sections_exist_only_for_what_ran():
    check = row("free_fall", "simulation", "check", 0.0, suite="validation", expected=0.0, tolerance=1.0)
    made_tables = tables.make_tables([check])
    content = document({}, [check], made_tables, [], [])
    assert [section["title"] for section in content["sections"]] == ["Validation: known answers"]
    assert content["definitions"] == [] and content["lead"] is None
    assert set(made_tables) == {"validation", "metrics"}


def test_no_number_of_the_report_is_infinite_or_nan():
    content = document({}, all_rows(), tables.make_tables(all_rows()), [], [])
    assert not re.search(r"\b(nan|inf|NaN|None)\b", json.dumps(content, allow_nan=False))


@pytest.mark.parametrize("what", ["absent", "empty", "broken config", "broken rows", "no rows"])
def test_no_run_folder_is_one_line_and_status_2(tmp_path, capsys, what):
    run = RunFolder(tmp_path / "run")
    if what != "absent":
        run.path.mkdir()
    if what not in ("absent", "empty"):
        run.write_config({})
        run.write_rows([])
    if what == "broken config":
        run.config_path.write_text("{", encoding="utf-8")
    if what == "broken rows":
        run.rows_path.write_text("a,b\n", encoding="utf-8")
    before = sorted(tmp_path.rglob("*"))
    assert build.main([str(run.path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("reports.build: ") and error.count("\n") == 1 and str(run.path) in error
    assert sorted(tmp_path.rglob("*")) == before


def test_a_broken_file_is_named_and_the_rest_goes_on(tmp_path, capsys):
    run = RunFolder(tmp_path)
    run.write_config({})
    run.write_rows(all_rows())
    path = run.trajectory_path(SCENES[0], "snug")
    path.parent.mkdir(parents=True)
    path.write_bytes(b"no mesh")
    (run.models).mkdir()
    (run.models / "snug-seed0.safetensors").write_bytes(b"\xff" * 20)
    assert build.main([str(tmp_path), "--no-opengl"]) == 1
    said = capsys.readouterr()
    assert "dressed-walk/snug.vtkhdf" in said.err and "snug-seed0.safetensors" in said.err
    assert said.out.strip() == str(run.report_path) and run.report_path.is_file()


@pytest.mark.parametrize("ending", ["kill -SEGV $$", "exit 0"])
def test_without_opengl_the_painter_draws(made, tmp_path, monkeypatch, ending):
    crashing = tmp_path / "python"
    crashing.write_text(f"#!/bin/sh\n{ending}\n", encoding="utf-8")
    crashing.chmod(0o755)
    monkeypatch.setattr(render.sys, "executable", str(crashing))
    garment = str(made.trajectory_path(SCENES[0], "snug"))
    body = str(made.trajectory_path(SCENES[0], "body"))
    view = render.View(garment, body, 2, (0.2, 1.25, 0.0), 0.8, str(tmp_path / "view.png"))
    assert render.render_views([view]) == "painter"
    from matplotlib.image import imread

    picture = imread(view.image)
    assert picture.shape[:2] == (render.SIZE[1], render.SIZE[0])
    # The sheet is in front of the body and of the same size: the middle has the cloth's hue, blue over red.
    red, _, blue = picture[picture.shape[0] // 2, picture.shape[1] // 2, :3]
    assert blue > red + 0.05
    assert picture[0, 0, :3].min() == 1.0


@pytest.mark.slow
def test_with_opengl_or_without_there_is_a_picture(made, tmp_path):
    garment = str(made.trajectory_path(SCENES[0], "snug"))
    view = render.View(garment, "", -1, (0.2, 1.25, 0.0), 0.8, str(tmp_path / "view.png"))
    assert render.render_views([view]) in ("OpenGL", "painter")
    from matplotlib.image import imread

    picture = imread(view.image)
    middle = picture[picture.shape[0] // 2, picture.shape[1] // 2, :3]
    assert middle[2] > middle[0] + 0.05 and picture[0, 0, :3].min() > 0.98


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


def test_histories_come_from_the_models_headers(made):
    history = training.read_history(made.models / "snug-seed0.safetensors")
    assert history is not None and history.kind == "snug" and not history.by_vertices
    assert history.column("loss").tolist() == [2.0, 1.0, 0.5]


def test_the_command_answers_without_loading_anything_heavy():
    probe = (
        "import sys, reports.build\n"
        "try:\n    reports.build.main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'matplotlib', 'torch', 'h5py', 'typst', 'pyvista', 'reference_sim', 'snug'}\n"
        "sys.exit(bool(heavy & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", probe], capture_output=True, timeout=60).returncode == 0


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
