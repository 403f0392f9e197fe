"""Dependence on mesh and time step: the same measures for each, and a mesh that fails."""

from __future__ import annotations

import dataclasses

import pytest
from plans import SMOKE, plan_of

from benchmarks import workers
from benchmarks.plan import OwnBody
from benchmarks.results import RunFolder
from benchmarks.studies import dependence, hard_motions
from reports import study_tables


def test_dependence_measures_each_mesh_and_time_step_the_same_way():
    preset = dataclasses.replace(SMOKE, frames=4, settle_frames=4, garment_vertices=200)
    told = []
    rows = dependence.of_one_mesh(None, told.append, preset, (1, 2))
    scenes = {row.scene for row in rows}
    assert scenes == {"dependence/mesh/200", "dependence/dt/60"} and sum(told) == 200 * 3
    assert {row.method for row in rows} == {"simulation", "skinning", "newton-1"}
    assert all(row.suite == "validation" and row.tolerance is None and row.status == "ok" for row in rows)
    value = {(row.scene, row.method, row.metric): row.value for row in rows}
    for scene in scenes:
        assert abs(value[scene, "simulation", "mesh/vertices"] - 200) < 40
        assert value[scene, "newton-1", "curvature/error"] > 0
        assert (scene, "simulation", "curvature/error") not in value
    # Skinning knows no time step; the simulation does.
    for metric in ("energy/strain", "energy/inertia", "curvature/mean"):
        here, there = (value["dependence/" + v, "skinning", metric] for v in ("mesh/200", "dt/60"))
        assert here == there
    own = [value["dependence/" + v, "simulation", "energy/strain"] for v in ("mesh/200", "dt/60")]
    assert own[0] != own[1]
    table = study_tables.dependence(rows)
    assert len(table.rows) == 6 and {line[0][-6:] for line in table.rows} == {"1/30 s", "1/60 s"}


def test_a_mesh_that_fails_is_a_row(tmp_path, monkeypatch):
    monkeypatch.setattr(
        workers, "run_jobs", lambda jobs, *_, **__: [workers.Failure(j.label, "x") for j in jobs]
    )
    rows = dependence.rows(plan_of(tmp_path), RunFolder(tmp_path), None)
    assert [row.status for row in rows] == ["failed"] * 2
    assert {row.scene for row in rows} == {"dependence/mesh/200", "dependence/mesh/300"}


def test_an_own_body_is_the_one_that_is_measured(tmp_path, monkeypatch):
    asked, opened = [], []
    monkeypatch.setattr(workers, "run_jobs", lambda jobs, *_, **__: asked.extend(jobs) or [[] for _ in jobs])

    def opening(*_, body, **__):
        opened.append(body)
        raise ValueError("no such body")

    monkeypatch.setattr("benchmarks.wardrobe.open_wardrobe", opening)
    own = OwnBody(tmp_path / "mine.npz", "0")
    dependence.rows(plan_of(tmp_path, body=own), RunFolder(tmp_path), None)
    for job in asked:
        with pytest.raises(ValueError, match="no such body"):
            job.function(None, lambda _: None, *job.arguments)
    with pytest.raises(ValueError, match="no such body"):
        hard_motions.rows(plan_of(tmp_path, body=own), RunFolder(tmp_path), None)
    assert opened == [own.path] * 3
