"""Cells: each in its own process, ended at a deadline, kept when finished, and taken up after a kill."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks import methods, run, stages
from benchmarks.agenda import Agenda
from benchmarks.cell import Outcome, failed
from benchmarks.cells import Cells
from benchmarks.outlook import describe
from benchmarks.plan import Cell, Plan
from benchmarks.presets import find_preset
from benchmarks.records import Records
from benchmarks.results import RunFolder
from benchmarks.rows import clock_costs, rows_of
from benchmarks.scenes import SMALL_SCENES

ROOT = Path(__file__).resolve().parent.parent
SCENES = {scene.name: scene for scene in SMALL_SCENES}
TINY = dataclasses.replace(find_preset("smoke"), sheet_cells=3, sheet_frames=4, cell_seconds=90.0, repeats=1)


def plan_of(folder: Path, *names: str, scene: str = "free_fall", **changes) -> Plan:
    cells = tuple(Cell(SCENES[scene], name, 0, ("speed",)) for name in names)
    values = {
        "preset": TINY, "suites": ("speed",), "cells": cells, "checks": (), "cases": (), "train": (),
        "test": (), "seeds": (0,), "device": "cpu", "folder": folder, "command": "",
    }  # fmt: skip
    return Plan(**(values | changes))


def harness(plan: Plan) -> Cells:
    return Cells(plan, Agenda(plan), Records(RunFolder(plan.folder), only=plan.only), None)


def outcome_of(plan: Plan, number: int = 0) -> Outcome:
    """Of one cell, its process ended."""
    one = dataclasses.replace(plan, cells=plan.cells[number : number + 1])
    return harness(one).all(obstacle=lambda cell: None, bar=no_bar)[0]


@pytest.fixture
def misbehaving(monkeypatch):
    """Makes methods, newton-1 unless others are named, do what `how` says."""

    def entries(how: str, *names: str) -> None:
        wrong, names = {"module": "misbehaving", "options": {"how": how}}, names or ("newton-1",)
        found = [dataclasses.replace(m, **wrong) if m.name in names else m for m in methods.METHODS]
        monkeypatch.setattr(methods, "METHODS", tuple(found))

    return entries


def no_bar(items, *_):
    return items


# --- processes -------------------------------------------------------------------------------------------


def test_a_cell_says_how_long_it_took_how_much_memory_and_what_it_loaded(tmp_path):
    plan = plan_of(tmp_path, "simulation", scene="hanging_sheet")
    outcome = outcome_of(plan)
    assert (outcome.status, outcome.recorded, outcome.frames) == ("ok", True, 3)
    assert 0.0 < outcome.seconds[0] < 10.0 and 50.0 < outcome.peak < 1000.0
    assert outcome.terms == "strain+bending+gravity+inertia"
    assert "reference_sim.energies.stretch_stvk" in outcome.modules and "numba" in outcome.modules
    snug = {name for name in outcome.modules if name.startswith("snug")}
    assert snug <= {"snug", "snug.recipe"}  # names of trainings, which the list of methods holds
    for name in ("torch", "igl", "reference_sim.obstacle", "reference_sim.energies.contact_penalty"):
        assert name not in outcome.modules, f"{name} was loaded"
    metrics = {row.metric: row for row in rows_of(outcome, clock_costs(outcome))}
    assert set(metrics) == {"cost/frame", "cost/peak"} and metrics["cost/peak"].unit == "MB"
    assert metrics["cost/frame"].value == pytest.approx(1e3 * outcome.seconds[0] / 3)


@pytest.mark.parametrize(
    ("how", "status", "word"),
    [
        ("raise", "failed", "RuntimeError: broken on purpose"),
        ("segfault", "failed", "SIGSEGV"),
        ("killed", "out-of-memory", "SIGKILL"),
        ("hungry", "out-of-memory", "no room"),
        ("early", "failed", "its time cannot be believed"),
        ("unheld", "failed", "OSError: no room left"),
    ],
)
def test_a_cell_that_goes_wrong_is_an_outcome_with_its_reason(how, status, word, tmp_path, misbehaving):
    misbehaving(how)
    plan = plan_of(tmp_path, "newton-1")
    outcome = outcome_of(plan)
    assert outcome.status == status and word in outcome.reason and not outcome.recorded
    (row,) = rows_of(outcome, {})
    assert (row.status, row.value) == (status, None) and not list(tmp_path.rglob("*.vtkhdf"))
    found = Records(RunFolder(tmp_path)).find(Agenda(plan).cell(plan.cells[0]))
    assert (found.state, found.wanted) == ("failed", False) and word in found.why


def test_a_cell_that_hangs_is_ended_with_all_that_it_has_started(tmp_path, misbehaving):
    misbehaving("hang")
    plan = plan_of(tmp_path, "newton-1", preset=dataclasses.replace(TINY, cell_seconds=4.0))
    outcome = outcome_of(plan)
    assert outcome.status == "timeout" and "4 s" in outcome.reason
    assert of_session(os.getsid(0), "time.sleep(60)") == []


def of_session(session: int, word: str = "") -> list[int]:
    """Processes of a session that have this word in their command line and are no zombies."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (path / "stat").read_text().rpartition(")")[2].split()[:4]
            line = (path / "cmdline").read_text()
        except OSError:
            continue  # it has just ended
        if int(its_session) == session and state != "Z" and word in line:
            found.append(int(path.name))
    return found


def test_memory_is_that_of_the_run_alone_and_many_at_once_are_watched_too(tmp_path, misbehaving):
    plan = plan_of(tmp_path, "newton-1")
    misbehaving("greedy")
    greedy = outcome_of(plan)
    assert greedy.status == "ok" and greedy.batch_seconds > 0.0 and greedy.peak < 300.0
    misbehaving("crowded")
    crowded = outcome_of(plan)
    assert crowded.status == "failed" and "many at once" in crowded.reason
    assert "cannot be believed" in crowded.reason
    assert not crowded.recorded and not list(tmp_path.rglob("*.vtkhdf"))


@pytest.mark.parametrize(
    ("how", "words"), [("crammed", ("out-of-memory", "SIGKILL")), ("torn", ("failed", "no two bodies"))]
)
def test_what_a_cell_has_run_stands_where_many_go_wrong(how, words, tmp_path, misbehaving):
    plan = plan_of(tmp_path, "newton-1")
    misbehaving(how)
    outcome = outcome_of(plan)
    assert (outcome.status, outcome.recorded, outcome.batch_seconds) == ("ok", True, None)
    assert f"many at once: {words[0]}" in outcome.reason and words[1] in outcome.reason
    assert RunFolder(tmp_path).trajectory_path("free_fall", "newton-1").is_file()
    assert harness(plan).first(plan.cells[0], None) == outcome


def test_torch_says_in_a_plain_error_that_there_is_no_room(tmp_path):
    said = "[enforce fail at alloc_cpu.cpp:117] err == 0. DefaultCPUAllocator: can't allocate memory"
    cell = plan_of(tmp_path, "newton-1").cells[0]
    assert failed(cell, RuntimeError(said)).status == "out-of-memory"
    assert failed(cell, RuntimeError("no such memory")).status == "failed"


# --- reuse -----------------------------------------------------------------------------------------------


def test_a_finished_cell_is_reused_until_something_that_it_uses_changes(tmp_path):
    plan = plan_of(tmp_path, "simulation")
    first = outcome_of(plan)
    again = harness(plan)
    assert again.first(plan.cells[0], None) == first and again.reused == [plan.cells[0].label]

    finer = dataclasses.replace(plan, preset=dataclasses.replace(TINY, sheet_cells=4))
    found = Records(RunFolder(tmp_path)).find(Agenda(finer).cell(finer.cells[0]))
    assert (found.state, found.why, found.wanted) == ("stale", "preset", True)
    kept = harness(dataclasses.replace(finer, only=frozenset({"missing"})))
    assert kept.first(plan.cells[0], None) == first and kept.outdated == {plan.cells[0].label: "preset"}

    elsewhere = dataclasses.replace(
        plan, preset=dataclasses.replace(TINY, garment_vertices=99, gap_samples=9)
    )
    assert outcome_of(elsewhere) == first

    RunFolder(tmp_path).trajectory_path("free_fall", "simulation").unlink()
    assert Records(RunFolder(tmp_path)).find(Agenda(plan).cell(plan.cells[0])).state == "missing"
    gone = harness(dataclasses.replace(plan, only=frozenset({"failed"})))
    left_out = gone.first(plan.cells[0], None)
    assert (left_out.status, left_out.recorded, gone.reused) == ("skipped", False, [])
    assert "left out" in describe(dataclasses.replace(plan, only=frozenset({"failed"})))


def test_a_cell_that_is_run_again_leaves_nothing_of_its_earlier_run(tmp_path, misbehaving):
    plan = plan_of(tmp_path, "simulation", "newton-1", "newton-4")
    folder, agenda = RunFolder(tmp_path), Agenda(plan)
    records = Records(folder)

    def measured() -> list[str]:
        """Methods whose metrics are there."""
        return [c.method for c in plan.cells if records.find(agenda.metrics(c)).state == "finished"]

    def after(number: int) -> list[str]:
        for cell in plan.cells:
            records.keep(agenda.metrics(cell), {}, seconds=0.0)
        folder.trajectory_path("free_fall", plan.cells[number].method).unlink(missing_ok=True)
        folder.held_path("free_fall", plan.cells[number].method).touch()
        outcome_of(plan, number)
        assert not folder.held_path("free_fall", plan.cells[number].method).exists()
        return measured()

    for number in range(3):
        outcome_of(plan, number)
    assert after(1) == ["simulation", "newton-4"]
    assert after(0) == []  # the others are compared with it
    misbehaving("raise")
    outcome_of(plan, 1)
    assert not folder.trajectory_path("free_fall", "newton-1").exists()


def test_only_what_is_asked_for_is_done(tmp_path, misbehaving):
    misbehaving("raise")
    plan = plan_of(tmp_path, "newton-1", "newton-4")
    assert outcome_of(plan).status == "failed"
    misbehaving("still")
    retry = dataclasses.replace(plan, only=frozenset({"failed"}))
    left_out = outcome_of(retry, 1)
    assert left_out.status == "skipped" and "--only" in left_out.reason


def test_repeats_take_turns_and_are_kept(tmp_path, misbehaving, monkeypatch):
    names = ("simulation", "newton-1", "newton-4")
    misbehaving("still", *names)
    preset = dataclasses.replace(TINY, repeats=3, repeat_seconds=60.0)
    plan = plan_of(tmp_path, *names, preset=preset)
    cells, order = harness(plan), []
    once_more = Cells._once_more

    def watched(self, cell, number):
        order.append((cell.method, number))
        return once_more(self, cell, number)

    monkeypatch.setattr(Cells, "_once_more", watched)
    repeated = cells.all(obstacle=lambda cell: None, bar=no_bar)
    assert [name for name, number in order if number == 1] == ["newton-1", "newton-4", "simulation"]
    assert [name for name, number in order if number == 2] == ["newton-4", "simulation", "newton-1"]
    assert all(len(outcome.seconds) == 3 for outcome in repeated)
    costs = clock_costs(repeated[0])
    assert costs["cost/frame"] == pytest.approx(1e3 * sorted(repeated[0].seconds)[1] / 4)
    assert costs["cost/spread"] > 0.0
    assert harness(plan).all(obstacle=lambda cell: None, bar=no_bar) == repeated


def test_a_repeat_that_fails_is_said_on_the_rows(tmp_path, misbehaving, monkeypatch):
    misbehaving("still")
    plan = plan_of(tmp_path, "newton-1", preset=dataclasses.replace(TINY, repeats=2, repeat_seconds=60.0))
    cells = harness(plan)
    crowd = Outcome(plan.cells[0], "failed", "more than one thread", (0.1,))
    monkeypatch.setattr(cells, "_once_more", lambda cell, number: crowd)
    (outcome,) = cells.all(obstacle=lambda cell: None, bar=no_bar)
    assert outcome.status == "ok" and len(outcome.seconds) == 1
    reasons = {row.reason for row in rows_of(outcome, clock_costs(outcome))}
    assert reasons == {"repeat 1: failed: more than one thread"}


def test_repeats_that_lie_apart_carry_a_remark(tmp_path):
    cell = plan_of(tmp_path, "simulation").cells[0]
    wide, near = (Outcome(cell, "ok", seconds=s, frames=1, recorded=True) for s in ((1.0, 1.5), (1.0, 1.1)))
    reasons = [{r.metric: r.reason for r in rows_of(o, clock_costs(o))} for o in (wide, near)]
    assert "20 %" in reasons[0]["cost/spread"] and reasons[0]["cost/frame"] == ""
    assert reasons[1]["cost/spread"] == ""


def test_a_dry_run_tells_what_is_there(tmp_path):
    plan = plan_of(tmp_path / "run", "simulation", "newton-1", "skinning")
    assert "2 pieces of work to run; 0 cached" in describe(plan) and not plan.folder.exists()
    outcome_of(plan)
    words = describe(plan)
    assert "free_fall x simulation [speed]: cached, metrics to be computed" in words
    assert "free_fall x newton-1 [speed]: run (missing)" in words and "skinning [speed]: skip" in words
    assert "1 pieces of work to run; 1 cached" in words
    stale = describe(dataclasses.replace(plan, preset=dataclasses.replace(TINY, sheet_frames=5)))
    assert "simulation [speed]: run (stale: preset), 0.0 s last time" in stale
    assert "2 pieces of work to run" in describe(dataclasses.replace(plan, fresh=True))


# --- a kill ----------------------------------------------------------------------------------------------


HANGING = """
import time
from benchmarks.guarded import Guarded
if __name__ == "__main__":
    with Guarded() as guarded:
        guarded.call(print, "begun", seconds=60)
        guarded.call(time.sleep, 60, seconds=60)
"""


def test_a_process_ends_when_its_parent_was_killed(tmp_path):
    (tmp_path / "hanging.py").write_text(HANGING)
    parent = subprocess.Popen(
        [sys.executable, tmp_path / "hanging.py"],
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    assert parent.stdout is not None and parent.stdout.readline() == b"begun\n"
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 30
    while of_session(parent.pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_killed_run_loses_the_running_cell_alone(tmp_path, monkeypatch):
    out = tmp_path / "run"
    words = ["--preset", "smoke", "--suite", "speed", "--scenes", "free_fall", "-o", str(out)]
    words += ["--methods", "simulation,newton-1,newton-4"]
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.run", *words],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    record = out / "records" / "cell" / "free_fall" / "simulation.json"
    deadline = time.monotonic() + 60
    while not record.is_file():
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    while of_session(process.pid):  # its cells end by themselves
        assert time.monotonic() < deadline
        time.sleep(0.05)
    before = record.read_bytes()

    monkeypatch.setattr(stages.Stages, "make_report", lambda self: True)
    assert run.main(words) == 0
    assert record.read_bytes() == before
    first = RunFolder(out).read_rows()
    assert {row.method for row in first} == {"simulation", "newton-1", "newton-4"}
    assert run.main(words) == 0
    assert RunFolder(out).read_rows() == first
    config = RunFolder(out).read_config()
    assert len(config["earlier"]) == 2 and config["clock"]["threads"] == 1
    assert not [path for path in out.rglob("*") if "part" in path.name]
