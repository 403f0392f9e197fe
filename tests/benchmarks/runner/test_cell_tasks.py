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

from benchmarks import run
from benchmarks.methods import find_method
from benchmarks.methods.outside import program
from benchmarks.plan.cell import Cell
from benchmarks.plan.plan import Plan
from benchmarks.presets import find_preset
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.cache import Cache
from benchmarks.runner.cells import CellProcess, begin_cell
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.rows import clock_costs, rows_of
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Context, Outcome, failure
from benchmarks.scenes import SCENES as DECLARED
from tests.benchmarks.runner.misbehaving import HANGING_CHILD
from tests.benchmarks.runner.tasks_by_hand import InProcess

ROOT = Path(__file__).resolve().parents[3]
SCENES = {scene.name: scene for scene in DECLARED}
NAMES = {"snug", "snug.recipe", "snug.named_recipes", "snug.kinds"}  # of trainings, in the list of methods
TINY = dataclasses.replace(
    find_preset("smoke"), sheet_cells=3, sheet_frames=4, cell_seconds=90.0, repeats=1, least_seconds=0.01
)


def plan_of(folder: Path, *names: str, scene: str = "free_fall", how: str = "", **changes) -> Plan:
    """how: what the methods that are no simulation do instead of their work."""
    preset = changes.get("preset", TINY)

    def entry(name):
        method = find_method(name)
        wrong = {
            "module": "tests.benchmarks.runner.misbehaving",
            "options": {"how": how},
            "batched": True,
            "gives_first_frame": True,
        }
        return dataclasses.replace(method, **wrong) if how and name != "simulation" else method

    cells = tuple(Cell(SCENES[scene].at(preset), entry(name), 0, ("speed",)) for name in names)
    values = {
        "preset": preset, "suites": ("speed",), "cells": cells, "cases": (), "seeds": (0,), "device": "cpu",
        "folder": folder, "command": "",
    }  # fmt: skip
    return Plan(**(values | changes))


def finish(plan: Plan, *stages: str, processes: bool = False) -> Runner:
    """All tasks of these stages, run or reused: here, or in processes of their own."""
    tasks = [task for task in tasks_of(plan) if task.stage in (stages or ("cells",))]
    folder = RunFolder(plan.folder)
    runner = Runner(tasks, Cache(folder, only=plan.only))
    runner.run(Executor(folder, None, 1) if processes else InProcess(folder))
    return runner


def outcome_of(plan: Plan, number: int = 0, *, processes: bool = False) -> Outcome:
    """Run one cell to the end of its process and return its outcome."""
    one = dataclasses.replace(plan, cells=plan.cells[number : number + 1])
    return finish(one, processes=processes).outcomes["cell", plan.cells[number].name]


def found_of(plan: Plan, kind: str = "cell", number: int = 0):
    """Return the cache entry of a cell, or of its metrics, in the plan's folder."""
    runner = Runner(tasks_of(plan), Cache(RunFolder(plan.folder), only=plan.only))
    return {task.id: entry for task, entry, _ in runner.preview()}[kind, plan.cells[number].name]


def rows_of_cell(runner: Runner, plan: Plan) -> list[Row]:
    return rows_of(plan, runner.tasks, runner.outcomes)


# --- processes -------------------------------------------------------------------------------------------


def test_only_a_method_of_the_project_is_prepared_before_its_turn(tmp_path):
    plan = plan_of(tmp_path, "newton-1", how="still")
    user_entry = dataclasses.replace(plan.cells[0].entry, declared_in="mine.py")
    for entry, prepared in ((plan.cells[0].entry, True), (user_entry, False)):
        context = Context(RunFolder(tmp_path))
        cell = dataclasses.replace(plan.cells[0], entry=entry)
        begin_cell(cell, context)
        process = CellProcess.of(context)
        assert (process.scene is not None, process.prepared is not None) == (prepared, prepared)


def test_a_cell_says_how_long_it_took_how_much_memory_and_what_it_loaded(tmp_path):
    plan = plan_of(tmp_path, "simulation", scene="hanging_sheet")
    outcome = outcome_of(plan, processes=True)
    result = outcome.result
    assert (outcome.status, len(outcome.files), result["frames"]) == ("ok", 1, 3)
    assert 0.0 < result["seconds"] < 10.0 and 50.0 < result["peak"] < 1000.0
    assert result["terms"] == "strain+bending+gravity+inertia"
    assert "reference_sim.energies.stretch_stvk" in result["modules"] and "numba" in result["modules"]
    assert {name for name in result["modules"] if name.startswith("snug")} <= NAMES
    for name in ("torch", "igl", "reference_sim.obstacle", "reference_sim.energies.contact_penalty"):
        assert name not in result["modules"], f"{name} was loaded"
    costs, remark = clock_costs(plan.cells[0], 1, {("cell", plan.cells[0].name): outcome})
    frames = {"cost/frame_p50", "cost/frame_p95", "cost/frame_worst"}
    assert set(costs) == {"cost/frame", "cost/whole", "cost/peak"} | frames and remark == ""
    assert costs["cost/frame"] == costs["cost/whole"] == pytest.approx(1e3 * result["seconds"] / 3)
    assert costs["cost/frame_p50"] <= costs["cost/frame_p95"] <= costs["cost/frame_worst"]
    assert result["runs"] > 1 or result["seconds"] > TINY.least_seconds


@pytest.mark.parametrize("scene", ["hanging_sheet", pytest.param("sheet_on_sphere", marks=pytest.mark.slow)])
def test_a_cell_loads_nothing_that_its_key_does_not_know(scene, tmp_path):
    """Modules that the process loaded are among the source that its entry in the cache is known by."""
    from benchmarks.runner.cache import dependencies

    plan = plan_of(tmp_path, "newton-1", scene=scene)
    loaded = outcome_of(plan, processes=True).result["modules"]
    known = dependencies(next(task for task in tasks_of(plan) if task.kind == "cell"))
    ours = {name for name in loaded if name.split(".")[0] in ("reference_sim", "snug")} - NAMES
    files = {name: name.replace(".", "/") for name in ours}
    places = tuple(f"{place.removesuffix('.py')}/" for place in known)
    missing = [name for name, stem in files.items() if not f"{stem}/".startswith(places)]
    assert missing == [] and len(files) > 10


@pytest.mark.parametrize(
    ("how", "status", "word"),
    [
        ("raise", "failed", "RuntimeError: broken on purpose"),
        ("segfault", "failed", "SIGSEGV"),
        ("killed", "out-of-memory", "SIGKILL"),
        ("hungry", "out-of-memory", "no room"),
        ("early", "failed", "its time cannot be believed"),
        ("unheld", "failed", "OSError: no room left"),
        ("late", "failed", "run() gives positions float64 (5, 16, 3): floats (4, 16, 3) are due"),
        ("narrow", "failed", "run() gives positions float64 (4, 15, 3): floats (4, 16, 3) are due"),
        ("astray", "failed", "quasi_static() gives positions float64 (4, 2, 3)"),
    ],
)
def test_a_cell_that_goes_wrong_is_an_outcome_with_its_reason(how, status, word, tmp_path):
    plan = plan_of(tmp_path, "newton-1", how=how)
    runner = finish(plan, "cells", "metrics", processes=True)  # other threads of the tests falsify its times
    outcome = runner.outcomes["cell", plan.cells[0].name]
    assert outcome.status == status and word in outcome.reason and outcome.failed and not outcome.files
    (row,) = rows_of_cell(runner, plan)
    assert (row.status, row.value) == (status, None) and not list(tmp_path.rglob("*.vtkhdf"))
    entry = found_of(plan)
    assert (entry.state, entry.wanted) == ("failed", False) and word in entry.why


@pytest.mark.slow
def test_a_cell_that_hangs_is_ended_with_all_that_it_has_started(tmp_path):
    plan = plan_of(tmp_path, "newton-1", how="hang", preset=dataclasses.replace(TINY, cell_seconds=4.0))
    outcome = outcome_of(plan, processes=True)
    assert outcome.status == "timeout" and "4 s" in outcome.reason
    deadline = time.monotonic() + 5.0  # what was killed may take a moment to go
    while of_session(os.getsid(0), HANGING_CHILD) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert of_session(os.getsid(0), HANGING_CHILD) == []


LEAVING = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
open(sys.argv[3], "w").write(str(child.pid))
time.sleep(60)
"""
LOOKING = """
import pathlib, sys
stat = pathlib.Path("/proc", open(sys.argv[3]).read(), "stat")
sys.exit("it runs on" if stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z" else "gone")
"""


@pytest.mark.slow
def test_what_a_program_has_started_ends_with_it_before_the_next_cell(tmp_path):
    cells = []
    for name, text, seconds in (("leaving", LEAVING, 3.0), ("looking", LOOKING, 60.0)):
        script = tmp_path / f"{name}.py"
        script.write_text(text)
        command = f"{sys.executable} -I {script} {{scene}} {{out}} {tmp_path / 'pid'}"
        entry = program(name, command, seconds=seconds)
        cells.append(Cell(SCENES["free_fall"].at(TINY), entry, 0, ("garments",)))
    runner = finish(
        plan_of(tmp_path / "run", cells=tuple(cells), suites=("garments",)), "cells that are not timed",
        processes=True,
    )  # fmt: skip
    first, second = (runner.outcomes["cell", cell.name] for cell in cells)
    assert first.status == "timeout" and second.reason.endswith("gone")


def of_session(session: int, word: str = "") -> list[int]:
    """Processes of a session that have this word in their command line and are no zombies."""
    processes = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (path / "stat").read_text().rpartition(")")[2].split()[:4]
            line = (path / "cmdline").read_text()
        except OSError:
            continue  # it has just ended
        if int(its_session) == session and state != "Z" and word in line:
            processes.append(int(path.name))
    return processes


@pytest.mark.slow
def test_memory_is_that_of_the_run_alone_and_many_at_once_are_watched_too(tmp_path):
    plan = plan_of(tmp_path / "greedy", "newton-1", how="greedy")
    runner = finish(plan, processes=True)
    name = plan.cells[0].name
    greedy = runner.outcomes["cell", name]
    assert greedy.status == "ok" and greedy.result["peak"] < 300.0
    assert runner.outcomes["batch", name].result["seconds"] > 0.0
    plan = plan_of(tmp_path / "crowded", "newton-1", how="crowded")
    (row,) = rows_of_cell(finish(plan, "cells", "metrics"), plan)
    assert row.status == "failed" and "many at once" in row.reason and row.value is None
    assert "cannot be believed" in row.reason


@pytest.mark.parametrize(
    ("how", "fragments"), [("crammed", ("out-of-memory", "SIGKILL")), ("torn", ("failed", "no two bodies"))]
)
def test_what_a_cell_has_run_stands_where_many_go_wrong(how, fragments, tmp_path):
    plan = plan_of(tmp_path, "newton-1", how=how)
    runner = finish(plan, "cells", "metrics", processes=how == "crammed")
    outcome = runner.outcomes["cell", plan.cells[0].name]
    assert (outcome.status, outcome.failed) == ("ok", False)
    rows = {row.metric: row for row in rows_of_cell(runner, plan)}
    assert rows["cost/frame"].status == "ok" and "cost/batch" not in rows
    reason = rows["cost/frame"].reason
    assert f"many at once: {fragments[0]}" in reason and fragments[1] in reason
    assert RunFolder(tmp_path).trajectory_path("free_fall", "newton-1").is_file()
    again = finish(plan, "cells", "metrics")
    assert {row.metric: row for row in rows_of_cell(again, plan)}.keys() == rows.keys()
    assert again.outcomes["cell", plan.cells[0].name].result == outcome.result


def test_torch_says_in_a_plain_error_that_there_is_no_room():
    message = "[enforce fail at alloc_cpu.cpp:117] err == 0. DefaultCPUAllocator: can't allocate memory"
    assert failure(RuntimeError(message)).status == "out-of-memory"
    assert failure(RuntimeError("no such memory")).status == "failed"


# --- a kill ----------------------------------------------------------------------------------------------


HANGING = """
import time
from contextlib import closing
from benchmarks.runner.isolated_process import IsolatedProcess
if __name__ == "__main__":
    with closing(IsolatedProcess()) as process:
        process.call(print, "begun", seconds=60)
        process.call(time.sleep, 60, seconds=60)
"""


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_killed_run_loses_the_running_cell_alone(tmp_path, monkeypatch):
    out = tmp_path / "run"
    options = ["smoke:speed", "--scenes", "free_fall", "-o", str(out)]
    options += ["--methods", "simulation,newton-1,newton-4"]
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.run", *options],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    entry = out / "cache" / "cell" / "free_fall" / "simulation.json"
    deadline = time.monotonic() + 60
    while not entry.is_file():
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    while of_session(process.pid):  # its cells end by themselves
        assert time.monotonic() < deadline
        time.sleep(0.05)
    before = entry.read_bytes()

    monkeypatch.setattr(execution, "make_report", lambda log: "")
    assert run.main(options) == 0
    assert entry.read_bytes() == before
    first = RunFolder(out).read_rows()
    assert {row.method for row in first} == {"simulation", "newton-1", "newton-4"}
    assert run.main(options) == 0
    assert RunFolder(out).read_rows() == first
    config = RunFolder(out).read_config()
    assert len(config["earlier"]) == 2 and config["clock"]["threads"] == 1
    assert not [path for path in out.rglob("*") if "part" in path.name]
