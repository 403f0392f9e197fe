"""A run's folder: one run at a time, nothing measured out of date, whole after an interrupt or a kill."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from misbehaving import interrupt_at
from test_cells import TINY, harness, of_session, outcome_of, plan_of

from benchmarks import run, stages
from benchmarks.agenda import Agenda
from benchmarks.cell import Outcome
from benchmarks.outlook import describe
from benchmarks.plan import Cell, Network
from benchmarks.record import Record
from benchmarks.records import Records, Work
from benchmarks.results import RunFolder
from benchmarks.salvage import finished_rows
from benchmarks.scenes import dressed_scene
from benchmarks.workers import Failure, Job

ROOT = Path(__file__).resolve().parent.parent
WORDS = ["--preset", "smoke", "--suite", "speed", "--scenes", "free_fall"]
HOLDING = """
import sys, time
from pathlib import Path
from benchmarks.lock import held
with held(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    monkeypatch.setattr(stages.Stages, "make_report", lambda self: True)


def words_of(folder: Path, *methods: str) -> list[str]:
    return [*WORDS, "-o", str(folder), "--methods", ",".join(methods)]


# --- one run at a time -----------------------------------------------------------------------------------


def test_a_second_run_in_the_same_folder_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    words, answers = words_of(tmp_path / "run", "simulation"), []

    def execute(plan):
        if len(answers) == 0:
            answers.append(None)
            answers.append(run.main(words))
        return 0

    monkeypatch.setattr(stages, "execute", execute)
    assert run.main(words) == 0 and answers == [None, 2]
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "another run" in said and str(tmp_path / "run") in said
    assert run.main(words) == 0  # the first has ended
    assert list((tmp_path / "run").iterdir()) == []


def test_a_killed_run_holds_its_folder_no_longer(tmp_path, monkeypatch):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, tmp_path],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == b"held\n"
    monkeypatch.setattr(stages, "execute", lambda plan: 0)
    assert run.main(words_of(tmp_path, "simulation")) == 2
    process.kill()
    process.wait()
    process.stdout.close()
    assert run.main(words_of(tmp_path, "simulation")) == 0


def test_what_a_killed_run_was_writing_is_removed(tmp_path):
    scene = tmp_path / "trajectories" / "free_fall"
    scene.mkdir(parents=True)
    for name in ("simulation.vtkhdf", "newton-1.vtkhdf.part", ".body.77.part.npy"):
        (scene / name).write_bytes(b"half")
    Record(plan_of(tmp_path))
    assert [path.name for path in scene.iterdir()] == ["simulation.vtkhdf"]


def test_a_fresh_run_goes_on_from_no_training_that_was_stopped(tmp_path):
    models = tmp_path / "models" / "tunic"
    models.mkdir(parents=True)
    stopped = models / ".snug-seed0.0123.checkpoint.safetensors"
    stopped.write_bytes(b"half")
    plan = plan_of(tmp_path)
    Record(plan)
    assert stopped.is_file()
    Record(dataclasses.replace(plan, fresh=True))
    assert not stopped.exists()


# --- a worker that is killed -----------------------------------------------------------------------------


@dataclasses.dataclass
class Written:
    files: tuple[str, ...] = ()


def write(wardrobe, tell):
    return Written()


def die(wardrobe, tell):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_piece_whose_worker_is_killed_is_recorded_as_failed_and_done_again_when_asked(tmp_path):
    works = [Work("network", name, {}, {}) for name in ("one", "two", "three")]

    def finished(*functions, **changes):
        each = stages.Stages(Record(plan_of(tmp_path, workers=1, **changes)))
        todo = {w: Job(w.name, f, (), 1) for w, f in zip(works, functions)}
        return list(each.finished(todo, title="x", unit="x").values()), each

    ended, each = finished(write, die, write)
    assert [isinstance(end, Failure) for end in ended] == [False, True, False]
    found = each.records.find(works[1])
    assert found.state == "failed" and found.why.startswith("out-of-memory") and "SIGKILL" in found.why
    assert each.broken == {"two": found.why}
    again, each = finished(die, write, die)
    assert again[1] == ended[1] and each.broken == {"two": found.why}
    again, each = finished(die, write, die, only=frozenset({"failed"}))
    assert not isinstance(again[1], Failure) and each.broken == {}


def test_a_network_that_learned_without_a_failed_simulation_is_another(tmp_path):
    plan = plan_of(tmp_path, train=("walk", "run"))
    whole, lacking = Agenda(plan), Agenda(plan)
    lacking.lost = frozenset({whole.data("run", "tshirt").name})
    for name, same in (("supervised", False), ("snug", True)):
        network = Network(name, 0)
        assert (whole.network(network).key == lacking.network(network).key) is same


def test_a_cell_that_was_blocked_is_run_once_nothing_blocks_it(tmp_path):
    plan = plan_of(tmp_path, "simulation")
    blocked = harness(plan).first(plan.cells[0], "its network could not be trained: killed")
    assert blocked.status == "failed" and "could not be trained" in blocked.reason
    only = dataclasses.replace(plan, only=frozenset({"failed"}))
    assert harness(only).first(plan.cells[0], "killed").status == "failed"
    assert outcome_of(plan).status == "ok"


def test_a_failed_piece_that_no_row_speaks_of_makes_the_exit_status_1(tmp_path, monkeypatch, capsys):
    def go_on(self):
        self.broken["dressed/walk"] = "out-of-memory: killed"

    monkeypatch.setattr(stages.Stages, "run", go_on)
    assert stages.execute(plan_of(tmp_path)) == 1
    assert "dressed/walk: out-of-memory: killed" in capsys.readouterr().err


# --- out of date -----------------------------------------------------------------------------------------


def test_what_is_out_of_date_is_not_measured_as_if_it_were_not(tmp_path):
    plan = plan_of(tmp_path, "simulation", "newton-1")
    one = dataclasses.replace(plan, cells=plan.cells[:1])
    assert stages.execute(one) == 0
    before = {row.metric: row.value for row in RunFolder(tmp_path).read_rows()}
    finer = dataclasses.replace(TINY, sheet_cells=4, sheet_frames=5)
    missing = dataclasses.replace(plan, preset=finer, only=frozenset({"missing"}))
    assert stages.execute(missing) == 0
    rows = RunFolder(tmp_path).read_rows()
    kept = [row for row in rows if row.method == "simulation"]
    assert {row.metric: row.value for row in kept} == before
    assert all(row.reason == "kept though preset changed" for row in kept)
    new = {row.metric for row in rows if row.method == "newton-1" and row.status == "ok"}
    assert "energy/total" in new and not any(metric.startswith("distance/") for metric in new)
    assert stages.execute(dataclasses.replace(missing, only=frozenset({"stale", "missing"}))) == 0
    rows = RunFolder(tmp_path).read_rows()
    assert any(row.metric == "distance/rms" and row.method == "newton-1" for row in rows)
    assert not any("kept" in row.reason for row in rows)


# --- interrupts and kills --------------------------------------------------------------------------------


def test_an_interrupted_continuation_keeps_the_rows_of_what_is_finished(tmp_path, monkeypatch):
    words = words_of(tmp_path, "simulation,newton-4")
    assert run.main(words) == 0
    before = RunFolder(tmp_path).read_rows()
    (tmp_path / "records" / "metrics" / "free_fall" / "newton-4.json").unlink()
    with monkeypatch.context() as patch:
        interrupt_at("newton-1", patch)
        assert run.main(words_of(tmp_path, "simulation,newton-1,newton-4")) == 130
    assert RunFolder(tmp_path).read_rows() == [row for row in before if row.method == "simulation"]
    assert run.main(words) == 0 and RunFolder(tmp_path).read_rows() == before


def test_an_interrupt_before_anything_is_known_leaves_the_last_table(tmp_path, monkeypatch):
    words = words_of(tmp_path, "simulation")
    assert run.main(words) == 0
    before = RunFolder(tmp_path).read_rows()

    def interrupt(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(stages.Stages, "run", interrupt)
    assert run.main([*words, "--fresh"]) == 130
    assert before and RunFolder(tmp_path).read_rows() == before


def test_an_interrupt_knows_which_simulations_have_failed(tmp_path):
    cell = Cell(dressed_scene("kick"), "supervised", 0, ("garments",))
    plan = plan_of(tmp_path, train=("walk", "run"), cells=(cell,))
    records, agenda = Records(RunFolder(tmp_path)), Agenda(plan)
    records.keep(agenda.data("run", "tshirt"), {}, seconds=0.0, failed="diverged")
    agenda.remember_lost(records)
    failed = dataclasses.asdict(Outcome(cell, "failed", "killed"))
    del failed["cell"], failed["commit"]
    records.keep(agenda.cell(cell), failed, seconds=0.0, failed="failed: killed")
    (row,) = finished_rows(Agenda(plan), records)
    assert (row.method, row.status, row.reason) == ("supervised", "failed", "killed")
    assert "train supervised seed 0: 60 steps, run (missing)" in describe(plan)
    assert "dressed/kick x supervised [garments]: cached (failed" in describe(plan)


@pytest.mark.slow
def test_killed_at_any_moment_a_run_ends_as_one_that_was_not(tmp_path):
    names = ("simulation", "newton-1", "newton-4", "lbfgs-5", "gradient-descent-10")
    assert run.main(words_of(tmp_path / "whole", *names)) == 0
    folder = tmp_path / "killed"
    words, killed = words_of(folder, *names), []
    for files in (1, 5, 9, 14, 19):  # in the folder when it is killed, a little later each time
        kept = {path: path.read_bytes() for path in folder.glob("records/cell/**/*.json")}
        process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.run", *words],
            cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        deadline = time.monotonic() + 120
        while process.poll() is None and sum(path.is_file() for path in folder.rglob("*")) < files:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(0.03 * files)
        process.kill()
        process.wait()
        killed.append(process.returncode)
        while of_session(process.pid):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert {path: path.read_bytes() for path in kept} == kept
    assert killed.count(-signal.SIGKILL) >= 4  # in the midst of it
    assert run.main(words) == 0
    assert measured(folder) == measured(tmp_path / "whole")
    assert not [path for path in folder.rglob("*") if "part" in path.name]


def measured(folder: Path) -> dict[tuple[str, str], tuple[float | None, str]]:
    """What does not come from clock and process."""
    rows = RunFolder(folder).read_rows()
    return {(r.method, r.metric): (r.value, r.status) for r in rows if not r.metric.startswith("cost/")}
