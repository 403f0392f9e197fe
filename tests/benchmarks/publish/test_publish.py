"""Published runs are made by one command, at one commit, and replaced whole."""

from __future__ import annotations

import shlex
import subprocess
from fnmatch import fnmatch
from types import SimpleNamespace

import pytest

from benchmarks.plan.plan import runs
from benchmarks.provenance import commit
from benchmarks.publish import __main__ as command
from benchmarks.publish.__main__ import PublishError, all_usable, keep, publish
from benchmarks.publish.published_runs import RUNS, PublishedRun
from benchmarks.results.json_file import ResultsError
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from reports.blocks import FIGURES
from tests.benchmarks.plan.planned import planned

FALL = "--preset smoke --suite speed --scenes free_fall --methods "


@pytest.mark.parametrize("name", RUNS)
def test_every_published_command_can_be_planned(name, tmp_path):
    for folder, line in command.commands(name, RUNS[name], tmp_path).items():
        plan = planned(*line[3:])
        assert plan.folder == folder and (plan.scenes or plan.cases)
        assert {cell.scene.name for cell in plan.cells if runs(cell)} == {scene.name for scene in plan.scenes}


def test_every_published_picture_is_one_that_reports_draw():
    patterns = [pattern for figure in FIGURES for pattern in figure.patterns]
    for run in RUNS.values():
        for name in run.pictures:
            assert any(fnmatch(f"{name}.png", pattern) for pattern in patterns), name


def test_what_is_published_is_replaced_whole_or_left(tmp_path):
    whole, target = tmp_path / "run", tmp_path / "published" / "run"
    for name in (
        "results.csv",
        "run.json",
        "report.pdf",
        "tables/energies.csv",
        "figures/lead.png",
        "x.vtkhdf",
    ):
        (whole / name).parent.mkdir(parents=True, exist_ok=True)
        (whole / name).write_text(name)
    (target / "tables").mkdir(parents=True)
    (target / "tables" / "old.csv").write_text("old")
    with pytest.raises(PublishError, match=r"figures/none\.png: not there"):
        keep(whole, target, ["none.png"])
    assert [path.name for path in target.rglob("*.*")] == ["old.csv"]
    keep(whole, target, ["lead.png"])
    kept = ["energies.csv", "lead.png", "report.pdf", "results.csv", "run.json"]
    assert sorted(path.name for path in target.rglob("*.*")) == kept
    assert [path.name for path in target.parent.iterdir()] == ["run"]


def test_a_run_that_fails_or_is_of_another_commit_is_left(tmp_path, monkeypatch):
    run, status = PublishedRun("?", {"": FALL + "newton-1"}), 1
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=status))
    with pytest.raises(PublishError, match="fall: exit status 1"):
        publish("fall", run, tmp_path, tmp_path / "kept", "abc")
    status = 0
    monkeypatch.setattr(RunFolder, "read_rows", lambda _: [SimpleNamespace(commit=c) for c in ("abc", "def")])
    with pytest.raises(PublishError, match="fall: rows of commit def"):
        publish("fall", run, tmp_path, tmp_path / "kept", "abc")
    assert not (tmp_path / "kept").exists()


@pytest.mark.parametrize(
    "suite, status, config, usable",
    [
        ("garments", "stalled", {"finished": "now"}, True),
        ("extremes", "diverged", {"finished": "now"}, True),
        ("extremes", "failed", {"finished": "now"}, False),
        ("garments", "diverged", {"finished": "now"}, False),
        ("garments", "ok", {"finished": None}, False),
        ("garments", "ok", {"finished": "now", "tasks": {"training": {"snug": {"failed": "?"}}}}, False),
    ],
)
def test_a_run_counts_where_it_ended_and_simulations_stalled_at_worst(
    tmp_path, suite, status, config, usable
):
    """benchmarks.run ends with status 1 for a stalled simulation, whose numbers count."""
    folder = RunFolder(tmp_path)
    assert not all_usable(folder)  # no rows yet
    fields = {
        "scene": "tshirt/kick",
        "method": "simulation",
        "seed": 0,
        "metric": "energy/total",
        "unit": "J",
    }
    row = Row(suite=suite, status=status, reason="why" * (status != "ok"), value=1.0, **fields)
    folder.write_rows([row])
    folder.write_config(config)
    assert all_usable(folder) == usable


def test_changes_that_no_commit_has_and_unknown_names_are_refused(monkeypatch, capsys):
    monkeypatch.setattr(command, "commit", lambda: "abc+changes")
    assert command.main(["quick"]) == 2 and "commit the changes first" in capsys.readouterr().err
    assert command.main(["quik"]) == 2 and "no published run 'quik'" in capsys.readouterr().err
    assert command.main(["--list"]) == 0
    shown = capsys.readouterr().out
    assert all(f"{name}: {run.question}" in shown for name, run in RUNS.items())


@pytest.mark.parametrize("error", [PublishError, ResultsError])
def test_a_run_that_lacks_a_picture_is_left_and_the_next_is_done(error, monkeypatch, capsys):
    done = []

    def without_picture(name, *_):
        done.append(name)
        raise error(f"{name}/figures/none.png: not there, and the documents show it")

    monkeypatch.setattr(command, "commit", lambda: "abc")
    monkeypatch.setattr(command, "publish", without_picture)
    assert command.main(["quick", "shapes"]) == 1 and done == ["quick", "shapes"]
    said = capsys.readouterr().err
    assert "quick: quick/figures/none.png: not there" in said and "; not published" in said


@pytest.mark.slow
def test_parts_are_merged_reported_and_kept(tmp_path):
    parts = {"one": FALL + "simulation,newton-1", "two": FALL + "newton-2"}
    films = {"fall.gif": "--scene free_fall --methods simulation,newton-1 --width 100"}
    run = PublishedRun("?", parts, ("error_against_time_free_fall",), films)
    publish("fall", run, tmp_path / "runs", tmp_path / "kept", commit())
    rows = RunFolder(tmp_path / "kept" / "fall").read_rows()
    assert {row.method for row in rows} == {"simulation", "newton-1", "newton-2"}
    assert (tmp_path / "kept" / "fall" / "fall.gif").stat().st_size > 1000
    line = RunFolder(tmp_path / "kept" / "fall").read_config()["command"]
    assert shlex.split(line) == ["python", "-m", "benchmarks.publish", "fall"]
    publish("fall", run, tmp_path / "runs", tmp_path / "kept", commit())
