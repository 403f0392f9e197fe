"""Checks and cases are computed once for the same code, and said to be failed where they are."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from benchmarks import judged
from benchmarks.agenda import Agenda
from benchmarks.check import run_check
from benchmarks.plan import Plan
from benchmarks.presets import find_preset
from benchmarks.records import Records
from benchmarks.results import RunFolder
from benchmarks.suites.extremes import CASES
from benchmarks.suites.validation import CHECKS


def test_a_check_is_computed_once_and_again_when_it_declares_something_else(tmp_path):
    plan = Plan(
        preset=find_preset("smoke"), suites=("validation",), cells=(), checks=(), cases=(), train=(), test=(),
        seeds=(0,), device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, records = Agenda(plan), Records(RunFolder(tmp_path))
    check, done = next(c for c in CHECKS if c.smoke), []

    def run(item):
        done.append(item)
        return run_check(item)

    first = judged.rows_of([check], run, agenda, records)
    assert judged.rows_of([check], run, agenda, records) == first and len(done) == 1
    off = dataclasses.replace(check, expected=(check.expected or 0.0) + 1e6, tolerance=1e-9)
    (failed,) = judged.rows_of([off], run, agenda, records)
    assert failed.status == "failed" and len(done) == 2
    assert records.find(judged.work_of(off, agenda)).state == "failed"
    assert judged.rows_of([off], run, agenda, records) == [failed] and len(done) == 2


def test_every_check_and_case_has_an_identity_of_its_own(tmp_path):
    plan = Plan(
        preset=find_preset("smoke"), suites=(), cells=(), checks=(), cases=(), train=(), test=(), seeds=(0,),
        device="cpu", folder=tmp_path, command="",
    )  # fmt: skip
    agenda, records = Agenda(plan), Records(RunFolder(tmp_path))
    works = [judged.work_of(item, agenda) for item in (*CHECKS, *CASES)]
    assert len({records.path(work) for work in works}) == len(works)
    assert all("reports/" not in path for work in works for path in work.code)


def test_a_case_depends_on_how_it_is_judged_and_on_the_body_that_it_reads_but_not_on_the_other_cases():
    plan = Plan(
        preset=find_preset("smoke"), suites=(), cells=(), checks=(), cases=(), train=(), test=(), seeds=(0,),
        device="cpu", folder=Path(), command="",
    )  # fmt: skip
    works = {case.name: judged.work_of(case, Agenda(plan)) for case in CASES}
    for work in works.values():
        assert {"benchmarks/suites/extremes.py", "benchmarks/checks/verdict.py"} < set(work.code)
        assert "benchmarks/suites/extreme_cases.py" not in work.code
    assert "snug/data/body.npz" in works["shirt_step"].inputs["files"]
    assert "files" not in works["twisted"].inputs
