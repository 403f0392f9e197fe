"""The report of a run: numbers as they are, dashes where there are none, the same bytes twice."""

from __future__ import annotations

import csv
import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.provenance import digest_of_file
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reports import build
from reports.figures.charts import energy_series
from reports.finished_run import read_run
from tests.reports.report_folder import (
    FRAMES,
    SCENES,
    SHOWN,
    all_rows,
    declaration,
    row,
    run_folder,
    run_of,
    sheet,
    write_mesh,
    write_roll_outs,
)

OLD = ("energy_series_flag.svg", "frames_tunic.svg")
KEPT = ("mine.png", "map.txt", "gap-relative_against_cost-frame.svg")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> RunFolder:
    """A whole run folder with its report, drawn without OpenGL, where figures of an earlier report lay."""
    metadata = {"preset": "smoke", "commit": "abc", "finished": "2030-01-02T03:04:05+00:00"}
    run = run_folder(tmp_path_factory.mktemp("run"), all_rows(), **metadata)
    write_roll_outs(run, SCENES, SHOWN)
    lines = [f"{s},{m},0,{k / 30},{0.1 * k},0.1" for s in SCENES for m in SHOWN for k in range(3)]
    head = "scene,method,seed,seconds,strain,bending"
    run.frame_energies_path.write_text("\n".join([head, *lines, ""]))
    run.figures.mkdir()
    for name in (*OLD, *KEPT):
        (run.figures / name).write_bytes(b"")
    assert build.main([str(run.path)]) == 0
    return run


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_table_1_is_the_mean_over_scenes(made):
    lines = {line["method"]: line for line in read_csv(made.tables / "energies.csv")}
    assert list(lines) == ["simulation", "skinning", "snug", "pbns"]
    totals = {method: float(line["energy/total [J]"]) for method, line in lines.items()}
    assert totals == pytest.approx({method: 1.5 * factor for method, factor in SHOWN.items()}, rel=1e-8)


def test_every_file_of_the_report_is_there(made):
    names = {path.name for path in made.tables.iterdir()}
    wanted = ("energies", "curvature", "cost", "validation", "extremes", "unfinished")
    assert {f"{name}.csv" for name in wanted} <= names
    assert {"for_your_paper.csv", "for_your_paper.tex"} <= {path.name for path in made.path.iterdir()}
    pictures = {path.name for path in made.figures.iterdir()}
    for stem in ("energy_series_tshirt-walk", "error_against_time"):
        assert {f"{stem}.svg", f"{stem}.png"} <= pictures
    assert {"frames_tshirt-walk.png", *KEPT} <= pictures and pictures.isdisjoint(OLD)
    assert made.report_path.read_bytes().startswith(b"%PDF")


def test_made_twice_it_is_the_same_to_the_byte(made):
    def contents() -> dict[str, bytes]:
        return {str(p): p.read_bytes() for p in sorted(made.path.rglob("*")) if p.is_file()}

    before = contents()
    assert build.main([str(made.path)]) == 0
    assert contents() == before


def test_failed_cells_are_listed_once_with_their_reason(made):
    lines = read_csv(made.tables / "unfinished.csv")
    cells = [(x["scene"], x["method"], x["status"], x["reason"]) for x in lines]
    assert cells == [
        ("tshirt/walk", "supervised", "failed", "diverged at step 7"),
        ("tshirt/jump", "supervised", "failed", "diverged at step 7"),
        ("hanging_sheet", "snug", "skipped", "no body here"),
    ]


def test_no_run_folder_is_one_line_and_status_2(tmp_path, refused):
    path = str(tmp_path / "run")
    assert refused(path, build.main, [path]).startswith("reports.build: ")


def test_a_broken_file_is_named_and_the_rest_goes_on(tmp_path, capsys):
    rows = [r for r in all_rows() if r.method in ("simulation", "skinning", "snug")]
    run = run_folder(tmp_path, rows)
    path = run.trajectory_path(SCENES[0], "snug")
    path.parent.mkdir(parents=True)
    path.write_bytes(b"no mesh")
    assert build.main([str(tmp_path)]) == 1
    streams = capsys.readouterr()
    assert "tshirt-walk/snug.vtkhdf" in streams.err
    assert streams.out.splitlines()[-1] == str(run.report_path) and run.report_path.is_file()
    assert streams.out.startswith("| Method ") and " SNUG's " in streams.out


def test_curves_beside_a_trajectory_are_its_own(tmp_path):
    run = run_folder(tmp_path, all_rows())
    path = run.trajectory_path(SCENES[0], "snug")
    write_mesh(path, *sheet(0.1), {"energy/strain": np.zeros(FRAMES), "iterations": np.ones(FRAMES)})
    np.savez(run.curves_path(SCENES[0], "snug"), **{"energy/strain": np.ones(FRAMES)})
    fields = read_run(run).roll_outs.cloth(SCENES[0], "snug", 0).frame_fields
    assert fields["energy/strain"].tolist() == fields["iterations"].tolist() == [1.0] * FRAMES
    run.curves_path(SCENES[0], "snug").write_bytes(b"no archive")
    results = read_run(run)
    assert results.roll_outs.cloth(SCENES[0], "snug", 0) is None and "snug.npz" in results.problems[0]


@pytest.mark.parametrize(
    ("role", "config", "says"),
    [
        ("boss", {}, "role 'boss' is none of reference"),
        ("", {"metrics": {"energy/total": {"of": "time"}}}, "of='time'"),
        ("", {"metrics": ["energy/total"]}, "run.json: does not fit"),
        ("", {"scenes": ["tshirt/walk"]}, "run.json: does not fit"),
    ],
)
def test_a_run_whose_files_do_not_fit_is_refused_by_name(tmp_path, refused, role, config, says):
    run = run_folder(tmp_path, [row(metric="energy/total", role=role)], **config)
    assert str(run.config_path) in refused(says, build.main, [str(tmp_path)])


def test_a_broken_copy_of_frame_energies_is_refused_and_scenes_without_rows_are_left_out(tmp_path):
    run, path = run_folder(tmp_path, [row("tshirt/jump")]), tmp_path / "frame_energies.csv.gz"
    lines = [f"{scene},snug,0,{k},{k + 1}" for scene in SCENES for k in range(99)]
    whole = gzip.compress("\n".join(["scene,method,seed,seconds,strain", *lines]).encode())
    path.write_bytes(whole)
    assert energy_series(read_run(run)).name == "energy_series_tshirt-jump"
    run.write_rows([row("tshirt/jump", value=None, status="failed", reason="no end")])
    assert energy_series(read_run(run)) is None
    path.write_bytes(whole[:-40])
    with pytest.raises(ResultsError, match=r"csv\.gz: not readable"):
        read_run(run)


def test_page_one_names_the_files_that_are_not_as_the_run_wrote_them(tmp_path):
    run = RunFolder(tmp_path)
    run.write_rows(all_rows())
    digests = {"results.csv": digest_of_file(run.rows_path), "trajectories/gone.vtkhdf": "0"}
    run.write_config(declaration(all_rows(), digests=digests))
    assert read_run(run).warnings == []
    run.write_rows(all_rows()[:-1])
    assert read_run(run).warnings == ["Not as the run wrote them: results.csv"]


def test_times_of_several_machines_are_named():
    times = [row(method=method, metric="cost/frame", unit="ms") for method in ("snug", "pbns")]
    trained = replace(times[0], metric="cost/train", unit="s", hardware="another")  # before its frames
    assert run_of([*times, trained]).warnings == []
    (warning,) = run_of([times[0], replace(times[1], hardware="another")]).warnings
    assert warning == "Times are of several machines: another, here"
