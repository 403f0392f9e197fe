"""Published runs are made by one command, at one commit, and replaced whole."""

from __future__ import annotations

import subprocess
from types import SimpleNamespace

import pytest
import torch

from benchmarks import publish as command
from benchmarks.plan.study import Show, read_study
from benchmarks.provenance import commit, digest_of_file
from benchmarks.publish import all_usable, is_published, keep, publish
from benchmarks.results.row import ResultsError, Row
from benchmarks.results.run_folder import RunFolder
from snug.networks.garment_network import make_network
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT

FALL = """question = "?"
sizes = "smoke"
[parts.speed]
scenes = ["free_fall"]
methods = ["simulation", "newton-1"]
[show]
films."fall.gif" = "--scene free_fall --methods simulation,newton-1 --width 100"
"""


@pytest.fixture
def fall(tmp_path) -> str:
    """A study of a user's own that is published."""
    (tmp_path / "fall.toml").write_text(FALL)
    return str(tmp_path / "fall.toml")


def test_what_is_published_is_replaced_whole_or_left(tmp_path):
    whole, target = tmp_path / "run", tmp_path / "published" / "run"
    made = "results.csv run.json report.pdf tables/energies.csv tables/energies_by_scene.csv figures/lead.png"
    for path in [*(whole / name for name in made.split()), target / "tables" / "old.csv"]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(path.name)
    for show in (Show(pictures=("none",)), Show(networks=("none",))):
        with pytest.raises(ResultsError, match=r"none[-.\w]*: not there"):
            keep(whole, target, show)
    assert [path.name for path in target.rglob("*.*")] == ["old.csv"]
    network = TrainedModel(
        "pbns", make_network("pbns", 141, 4, DEFAULT, seed=0), DEFAULT, origin={"a": 1}
    )
    network.save(whole / "models/pbns-seed0.safetensors")
    rows = [
        Row("garments", "flag", "newton-1", 0, "energy/total", "J", value=0.1, moved=(("twin", 1 / 3),))
    ]
    RunFolder(whole).write_rows(rows)
    keep(whole, target, Show(pictures=("lead",), networks=("pbns",)))
    published = RunFolder(target)
    assert published.read_rows() == rows and rows[0].moved == (("twin", 0.3333),)
    digests = {"results.csv": digest_of_file(whole / "results.csv")}
    assert not published.find_changes(digests)
    copy = target / "results.csv.gz"
    for damaged in (copy.read_bytes()[:-9], b"\x1f\x8b\x08" + bytes(60), b"no gzip"):
        copy.write_bytes(damaged)
        assert published.find_changes(digests) == {"results.csv": "damaged"}
        with pytest.raises(ResultsError, match=r"results\.csv: line"):
            published.read_rows()
    files = "energies.csv lead.png pbns-seed0.safetensors report.pdf results.csv.gz run.json"
    assert sorted(path.name for path in target.rglob("*.*")) == files.split()
    assert [path.name for path in target.parent.iterdir()] == ["run"]
    rounded = TrainedModel.load(target / "models/pbns-seed0.safetensors")
    assert rounded.origin == network.origin
    for ours, theirs in zip(rounded.network.parameters(), network.network.parameters(), strict=True):
        assert ours.dtype == theirs.dtype and torch.allclose(ours, theirs, rtol=1e-3, atol=1e-7)


def test_a_run_that_fails_or_is_of_another_commit_is_left(tmp_path, monkeypatch, fall):
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: None)
    with pytest.raises(ResultsError, match="fall: has failed"):
        publish(fall, tmp_path, tmp_path / "kept", "abc")
    monkeypatch.setattr(command, "all_usable", lambda folder: True)
    monkeypatch.setattr(
        RunFolder, "read_rows", lambda _: [SimpleNamespace(commit=c) for c in ("abc", "def")]
    )
    with pytest.raises(ResultsError, match="fall: rows of commit def"):
        publish(fall, tmp_path, tmp_path / "kept", "abc")
    assert not (tmp_path / "kept").exists()


FAILED = {"tasks": {"training": {"snug": {"failed": "?"}}}}


@pytest.mark.parametrize("status, finished, more, usable", [
    ("stalled", "now", {}, True), ("diverged", "now", {}, False), ("ok", None, {}, False),
    ("ok", "now", FAILED, False),
])  # fmt: skip
def test_a_run_counts_where_it_ended_and_simulations_stalled_at_worst(
    tmp_path, status, finished, more, usable
):
    """benchmarks.run ends with status 1 for a stalled simulation, whose numbers count."""
    folder, reason = RunFolder(tmp_path), "why" * (status != "ok")
    assert not all_usable(folder)  # no rows yet
    key = ("garments", "tshirt/kick", "simulation", 0, "energy/total", "J")
    folder.write_rows([Row(*key, status=status, reason=reason, value=1.0)])
    folder.write_config({"finished": finished} | more)
    assert all_usable(folder) == usable


@pytest.mark.slow
def test_a_study_is_run_drawn_and_kept(tmp_path, fall):
    for _ in range(2):
        assert not is_published(tmp_path / "kept" / "fall", read_study(fall), "abc")
        command.publish(fall, tmp_path / "runs", tmp_path / "kept", commit())
    assert is_published(tmp_path / "kept" / "fall", read_study(fall), commit())
    rows = RunFolder(tmp_path / "kept" / "fall").read_rows()
    assert {row.method for row in rows} == {"simulation", "newton-1"}
    assert (tmp_path / "kept" / "fall" / "fall.gif").stat().st_size > 1000
    assert RunFolder(tmp_path / "kept" / "fall").read_config()["study"]["question"] == "?"
