"""Published runs are made by one command, at one commit, and replaced whole."""

from __future__ import annotations

import subprocess
from types import SimpleNamespace

import pytest

from benchmarks import publish as command
from benchmarks.provenance import commit
from benchmarks.publish import all_usable, keep, publish
from benchmarks.results.row import ResultsError, Row
from benchmarks.results.run_folder import RunFolder

FALL = """question = "?"
sizes = "smoke"
[parts.speed]
scenes = ["free_fall"]
methods = ["simulation", "newton-1"]
[show]
pictures = ["error_against_time_free_fall"]
films."fall.gif" = "--scene free_fall --methods simulation,newton-1 --width 100"
"""


@pytest.fixture
def fall(tmp_path) -> str:
    """A study of a user's own that is published."""
    (tmp_path / "fall.toml").write_text(FALL)
    return str(tmp_path / "fall.toml")


def test_what_is_published_is_replaced_whole_or_left(tmp_path):
    whole, target = tmp_path / "run", tmp_path / "published" / "run"
    made = "results.csv run.json report.pdf tables/energies.csv figures/lead.png x.vtkhdf"
    for name in made.split():
        (whole / name).parent.mkdir(parents=True, exist_ok=True)
        (whole / name).write_text(name)
    (target / "tables").mkdir(parents=True)
    (target / "tables" / "old.csv").write_text("old")
    with pytest.raises(ResultsError, match=r"figures/none\.png: not there"):
        keep(whole, target, ["none.png"])
    assert [path.name for path in target.rglob("*.*")] == ["old.csv"]
    keep(whole, target, ["lead.png"])
    kept = ["energies.csv", "lead.png", "report.pdf", "results.csv", "run.json"]
    assert sorted(path.name for path in target.rglob("*.*")) == kept
    assert [path.name for path in target.parent.iterdir()] == ["run"]


def test_a_run_that_fails_or_is_of_another_commit_is_left(tmp_path, monkeypatch, fall):
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: None)
    with pytest.raises(ResultsError, match="fall: has failed"):
        publish(fall, tmp_path, tmp_path / "kept", "abc")
    monkeypatch.setattr(command, "all_usable", lambda folder: True)
    monkeypatch.setattr(RunFolder, "read_rows", lambda _: [SimpleNamespace(commit=c) for c in ("abc", "def")])
    with pytest.raises(ResultsError, match="fall: rows of commit def"):
        publish(fall, tmp_path, tmp_path / "kept", "abc")
    assert not (tmp_path / "kept").exists()


@pytest.mark.parametrize(
    "suite, status, config, usable",
    [
        ("garments", "stalled", {"finished": "now"}, True),
        ("extremes", "diverged", {"finished": "now"}, True),
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
    what = (suite, "tshirt/kick", "simulation", 0, "energy/total", "J")
    row = Row(*what, status=status, reason="why" * (status != "ok"), value=1.0)
    folder.write_rows([row])
    folder.write_config(config)
    assert all_usable(folder) == usable


def test_changes_that_no_commit_has_and_unknown_names_are_refused(monkeypatch, capsys):
    monkeypatch.setattr(command, "commit", lambda: "abc+changes")
    assert command.main(["quick"]) == 2 and "commit the changes first" in capsys.readouterr().err
    assert command.main(["quik"]) == 2 and "no study 'quik'" in capsys.readouterr().err
    assert command.main(["smoke"]) == 2 and "study smoke: has no [show]" in capsys.readouterr().err


def test_a_run_that_lacks_a_picture_is_left_and_the_next_is_done(monkeypatch, capsys):
    done = []

    def without_picture(name, *_):
        done.append(name)
        raise ResultsError(f"{name}/figures/none.png: not there, and the documents show it")

    monkeypatch.setattr(command, "commit", lambda: "abc")
    monkeypatch.setattr(command, "publish", without_picture)
    assert command.main(["quick", "shapes"]) == 1 and done == ["quick", "shapes"]
    said = capsys.readouterr().err
    assert "quick: quick/figures/none.png: not there" in said and "; not published" in said


@pytest.mark.slow
def test_a_study_is_run_drawn_and_kept(tmp_path, fall):
    for _ in range(2):
        command.publish(fall, tmp_path / "runs", tmp_path / "kept", commit())
    rows = RunFolder(tmp_path / "kept" / "fall").read_rows()
    assert {row.method for row in rows} == {"simulation", "newton-1"}
    assert (tmp_path / "kept" / "fall" / "fall.gif").stat().st_size > 1000
    assert RunFolder(tmp_path / "kept" / "fall").read_config()["study"]["question"] == "?"
