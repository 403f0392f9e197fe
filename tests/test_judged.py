"""Checks, cases and studies are computed once for the same code, and said to be failed where they are."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from benchmarks import judged
from benchmarks.agenda import Agenda
from benchmarks.outlook import describe
from benchmarks.plan import Cell, Plan
from benchmarks.presets import find_preset
from benchmarks.records import Records
from benchmarks.results import Row, RunFolder
from benchmarks.scenes import dressed_scene
from benchmarks.studies import STUDIES
from benchmarks.study import Study
from benchmarks.validation.case import Case
from benchmarks.validation.registry import CASES, KNOWN_ANSWERS, STRESS_TESTS
from snug.recipe import DEFAULT


def test_a_check_is_computed_once_and_again_when_it_declares_something_else(tmp_path):
    plan = Plan(
        preset=find_preset("smoke"), suites=("validation",), cells=(), checks=(), cases=(), train=(), test=(),
        seeds=(0,), device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, records = Agenda(plan), Records(RunFolder(tmp_path))
    check, done = next(c for c in KNOWN_ANSWERS if c.smoke), []

    def run(item):
        done.append(item)
        return item.run()

    first = judged.rows_of([check], run, agenda, records)
    assert judged.rows_of([check], run, agenda, records) == first and len(done) == 1
    off = dataclasses.replace(check, expected=(check.expected or 0.0) + 1e6, tolerance=1e-9)
    (failed,) = judged.rows_of([off], run, agenda, records)
    assert failed.status == "failed" and len(done) == 2
    assert records.find(judged.work_of(off, agenda)).state == "failed"
    assert judged.rows_of([off], run, agenda, records) == [failed] and len(done) == 2


def test_a_check_that_is_kept_though_it_is_out_of_date_says_so(tmp_path):
    plan = Plan(
        preset=find_preset("smoke"), suites=("validation",), cells=(), checks=(), cases=(), train=(), test=(),
        seeds=(0,), device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, check = Agenda(plan), next(c for c in KNOWN_ANSWERS if c.smoke)
    judged.rows_of([check], Case.run, agenda, Records(RunFolder(tmp_path)))
    finer = dataclasses.replace(check, tolerance=1e-30)
    only = Records(RunFolder(tmp_path), only=("missing",))
    (row,) = judged.rows_of([finer], Case.run, agenda, only)
    assert row.status == "ok" and row.reason == "kept though declared changed"


def test_every_check_and_case_has_an_identity_of_its_own(tmp_path):
    plan = Plan(
        preset=find_preset("smoke"), suites=(), cells=(), checks=(), cases=(), train=(), test=(), seeds=(0,),
        device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, records = Agenda(plan), Records(RunFolder(tmp_path))
    works = [judged.work_of(item, agenda) for item in CASES]
    assert len({records.path(work) for work in works}) == len(works)
    assert all("reports/" not in path for work in works for path in work.code)


def test_a_case_depends_on_how_it_is_judged_and_on_the_body_that_it_reads_but_not_on_the_other_cases():
    plan = Plan(
        preset=find_preset("smoke"), suites=(), cells=(), checks=(), cases=(), train=(), test=(), seeds=(0,),
        device="cpu", folder=Path(), command="",
    )  # fmt: skip
    works = {case.name: judged.work_of(case, Agenda(plan)) for case in STRESS_TESTS}
    for work in works.values():
        assert {f"benchmarks/validation/{name}.py" for name in ("case", "convergence_check")} < set(work.code)
        assert "benchmarks/validation/stress_tests.py" not in work.code
    assert "snug/data/body.npz" in works["shirt_step"].inputs["files"]
    assert "files" not in works["twisted"].inputs


# --- studies ---------------------------------------------------------------------------------------------

done: list[str] = []


def rows(plan, folder, wardrobe) -> list[Row]:
    """Of the study below: a number, and one that failed honestly."""
    done.append(plan.preset.name)
    lost = Row("validation", "counting", "simulation", 0, "x", "1", None, "diverged", "far away")
    return [Row("validation", "counting", "simulation", 0, "n", "1", 0.1 + 0.2), lost]


def test_a_study_is_done_once_and_again_when_what_it_reads_is_another(tmp_path):
    study = Study(
        name="counting", description="", suite="validation", module="test_judged", reads=("roll-outs",)
    )
    cell = Cell(dressed_scene("kick", "tshirt"), "simulation", 0, ("garments",))
    plan = Plan(
        preset=find_preset("smoke"), suites=("validation",), cells=(cell,), checks=(), cases=(),
        studies=(study,), train=(), test=("kick",), seeds=(0,), device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, records = Agenda(plan), Records(RunFolder(tmp_path))
    assert "counting [validation]: run (missing)" in describe(plan)
    done.clear()
    first = judged.rows_of_study(study, agenda, records, None)
    assert judged.rows_of_study(study, agenda, records, None) == first and len(done) == 1
    assert "counting [validation]: cached" in describe(plan)
    records.keep(agenda.cell(cell), {}, seconds=0.0)  # there is a roll-out now
    assert "counting [validation]: run (stale: read)" in describe(plan)
    assert judged.rows_of_study(study, agenda, records, None) == first and len(done) == 2
    longer = dataclasses.replace(plan, preset=dataclasses.replace(plan.preset, frames=21))
    stale = judged.rows_of_study(study, Agenda(longer), records, None)
    assert [row.status for row in stale] == ["skipped"] and "kept though" in stale[0].reason
    assert len(done) == 2  # a study is not built upon a roll-out that is out of date
    only = dataclasses.replace(longer, only=frozenset({"missing"}))
    kept = judged.rows_of_study(study, Agenda(longer), Records(RunFolder(tmp_path), only=only.only), None)
    assert [row.value for row in kept] == [row.value for row in first]
    assert all("kept though" in row.reason for row in kept) and "far away" in kept[1].reason
    records.path(judged.work_of_study(study, Agenda(longer), records)).unlink()
    assert "counting [validation]: skip (not built upon cell dressed-kick/simulation" in describe(only)
    assert "counting [validation]: run (missing)" in describe(longer)
    records.keep(Agenda(longer).cell(cell), {}, seconds=0.0)
    judged.rows_of_study(study, Agenda(longer), records, None)
    assert len(done) == 3
    left_out = Records(RunFolder(tmp_path / "new"), only=("failed",))
    assert judged.rows_of_study(study, agenda, left_out, None) == [] and len(done) == 3


@pytest.mark.parametrize("name", ["dependence", "hard_motions"])
def test_a_study_depends_on_what_it_reaches_by_name(name, tmp_path, monkeypatch):
    study = next(study for study in STUDIES if study.name == name)
    plan = Plan(
        preset=find_preset("smoke"), suites=(), cells=(), checks=(), cases=(), train=(), test=(), seeds=(0,),
        device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, records = Agenda(plan), Records(RunFolder(tmp_path))
    work = judged.work_of_study(study, agenda, records)
    assert {"benchmarks/scenes/dressed_body.py", "benchmarks/methods/skinning.py"} < set(work.code)
    monkeypatch.setattr(judged, "DEFAULT", dataclasses.replace(DEFAULT, smoothing=DEFAULT.smoothing + 1))
    other = judged.work_of_study(study, agenda, records)
    assert [part for part in work.parts if other.parts[part] != work.parts[part]] == ["recipe"]


def test_every_study_says_what_it_reads():
    assert {study.name: set(study.reads) for study in STUDIES} == {
        "laws": {"roll-outs"},
        "hard_motions": {"networks"},
        "training_windows": {"networks"},
        "long_roll_outs": {"networks", "motions"},
        "dependence": set(),
    }
