"""The command: quick to answer, one clear line for a wrong word, honest about what failed."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks import methods as methods
from benchmarks import run
from benchmarks.methods import METHODS
from benchmarks.plan.plan import make_plan
from benchmarks.results.run_folder import RunFolder
from reference_sim.files.array_file import read_arrays
from tests.benchmarks.plan.planned import planned


def test_the_list_has_the_scenes_that_the_study_measures(capsys):
    assert run.main(["--list", "smoke:speed"]) == 0
    measured = capsys.readouterr().out.partition("where none is named")[2].partition("\n\n")[0]
    names = measured.splitlines()[1].split("speed", 1)[1].strip().split(", ")
    assert names == [scene.name for scene in planned("smoke:speed").scenes]
    assert len(measured.splitlines()) == 2


@pytest.fixture
def misbehaving(monkeypatch):
    """newton-1 raises when it is made ready; the others are as they are."""
    wrong = {"module": "tests.benchmarks.runner.misbehaving", "options": {"how": "raise"}}
    entries = tuple(dataclasses.replace(m, **wrong) if m.name == "newton-1" else m for m in METHODS)
    monkeypatch.setattr(methods, "METHODS", entries)
    monkeypatch.setitem(make_plan.__globals__, "METHODS", entries)


def test_a_failed_cell_is_a_row_and_the_rest_goes_on(tmp_path, misbehaving, capsys):
    out = tmp_path / "run"
    options = ["smoke:speed", "--scenes", "free_fall", "-o", str(out)]
    assert run.main([*options, "--methods", "simulation,newton-1,newton-4,skinning"]) == 1
    rows = RunFolder(out).read_rows()
    by_method = {row.method: row for row in rows if row.metric == "cost/frame"}
    assert by_method["newton-1"].status == "failed"
    assert by_method["newton-1"].reason == "RuntimeError: broken on purpose"
    assert by_method["newton-4"].status == by_method["simulation"].status == "ok"
    assert by_method["skinning"].status == "skipped" and "no body" in by_method["skinning"].reason
    exact = {row.method: row.value for row in rows if row.metric == "exact/distance"}
    assert exact["simulation"] < 1e-12
    config = RunFolder(out).read_config()
    assert config["finished"] and config["commit"] and config["versions"]["numpy"]
    assert {stage["name"] for stage in config["stages"]} >= {"cells", "metrics"}
    shown, log = capsys.readouterr()
    assert shown.strip().splitlines()[-1] == str((out / "report.pdf").resolve())
    assert "newton-1" in log and (out / "report.pdf").stat().st_size > 1000
    fields = read_arrays(RunFolder(out).curves_path("free_fall", "simulation"))
    assert {"energy/gravity", "energy/inertia", "energy/total"} <= set(fields)
    assert not [path for path in out.rglob("*") if "part" in path.name]
