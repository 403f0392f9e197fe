"""The report of a run: numbers as they are, dashes where there are none, the same bytes twice."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from report_folder import FRAMES, METHODS, SCENES, TERMS, all_rows, sheet, write_mesh, write_model

from benchmarks.results import RunFolder
from reports import build, render, training


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


def test_histories_come_from_the_models_headers(made):
    history = training.read_history(made.models / "snug-seed0.safetensors")
    assert history is not None and history.method == "snug" and history.panel == training.PHYSICS
    assert history.column("loss").tolist() == [2.0, 1.0, 0.5]
    taught = [training.History("m", [{"loss": 1.0, term: 1.0}]) for term in ("vertices", "low", "strain")]
    assert len({history.panel for history in taught}) == 3


def test_the_command_answers_without_loading_anything_heavy():
    probe = (
        "import sys, reports.build\n"
        "try:\n    reports.build.main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'matplotlib', 'torch', 'h5py', 'typst', 'pyvista', 'reference_sim', 'snug'}\n"
        "sys.exit(bool(heavy & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", probe], capture_output=True, timeout=60).returncode == 0
