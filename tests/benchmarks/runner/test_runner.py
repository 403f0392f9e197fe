"""A run's folder: one run at a time, nothing measured out of date, whole after an interrupt or a kill."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.methods import find_method
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.plan.plan import Network
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.cache import Cache
from benchmarks.runner.loop import Runner, _batches
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import RunLog
from benchmarks.runner.schedule import Schedule, tasks_of
from benchmarks.runner.task import Outcome
from benchmarks.scenes import of_garment
from tests.benchmarks.plan.planned import planned
from tests.benchmarks.runner.misbehaving import interrupt_at
from tests.benchmarks.runner.tasks_by_hand import run_in_this_process
from tests.benchmarks.runner.test_cell_tasks import TINY, found_of, plan_of

ROOT = Path(__file__).resolve().parents[3]
WORDS = ["smoke:speed", "--scenes", "free_fall"]
HOLDING = """
import sys, time
from pathlib import Path
from benchmarks.runner.execute_plan import held
with held(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    run_in_this_process(monkeypatch)


def words_of(folder: Path, *methods: str) -> list[str]:
    return [*WORDS, "-o", str(folder), "--methods", ",".join(methods)]


# --- one run at a time -----------------------------------------------------------------------------------


def test_a_second_run_in_the_same_folder_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    options, answers = words_of(tmp_path / "run", "simulation"), []

    def execute(plan, assets, *, report):
        if len(answers) == 0:
            answers.append(None)
            answers.append(run.main(options))
        return 0

    monkeypatch.setattr(execution, "execute", execute)
    assert run.main(options) == 0 and answers == [None, 2]
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "another run" in error and str(tmp_path / "run") in error
    assert run.main(options) == 0  # the first has ended
    assert not (tmp_path / "run").exists()  # nothing was written there


@pytest.mark.slow
def test_a_killed_run_holds_its_folder_no_longer(tmp_path, monkeypatch):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, tmp_path],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == b"held\n"
    monkeypatch.setattr(execution, "execute", lambda plan, assets, **_: 0)
    assert run.main(words_of(tmp_path, "simulation")) == 2
    process.kill()
    process.wait()
    process.stdout.close()
    assert run.main(words_of(tmp_path, "simulation")) == 0


def test_a_folder_of_an_earlier_version_is_refused_in_one_line(tmp_path, refused):
    (tmp_path / "run.json").write_text('{"command": "python -m benchmarks.run", "finished": null}')
    assert "new folder" in refused("earlier version", run.main, words_of(tmp_path, "simulation"))


def test_what_a_killed_run_was_writing_is_removed(tmp_path):
    scene = tmp_path / "trajectories" / "free_fall"
    scene.mkdir(parents=True)
    for name in ("simulation.vtkhdf", "newton-1.vtkhdf.part", ".body.77.part.npy"):
        (scene / name).write_bytes(b"half")
    RunLog(plan_of(tmp_path))
    assert [path.name for path in scene.iterdir()] == ["simulation.vtkhdf"]


def test_a_fresh_run_goes_on_from_no_training_that_was_stopped(tmp_path):
    models = tmp_path / "models" / "tunic"
    models.mkdir(parents=True)
    stopped = models / ".snug-seed0.checkpoint.safetensors"
    stopped.write_bytes(b"half")
    plan = plan_of(tmp_path)
    RunLog(plan)
    assert stopped.is_file()
    RunLog(dataclasses.replace(plan, fresh=True))
    assert not stopped.exists()


# --- out of date -----------------------------------------------------------------------------------------


def test_what_is_out_of_date_is_not_measured_as_if_it_were_not(tmp_path):
    plan = plan_of(tmp_path, "simulation", "newton-1")
    one = dataclasses.replace(plan, cells=plan.cells[:1])
    assert execution.execute(one) == 0
    before = {row.metric: row.value for row in RunFolder(tmp_path).read_rows()}
    finer = dataclasses.replace(TINY, sheet_cells=4, sheet_frames=5)
    missing = plan_of(tmp_path, "simulation", "newton-1", preset=finer, only=frozenset({"missing"}))
    assert execution.execute(missing) == 0
    rows = RunFolder(tmp_path).read_rows()
    kept = [row for row in rows if row.method == "simulation"]
    assert {row.metric: row.value for row in kept} == before
    assert all(row.reason == "kept though scene changed" for row in kept)
    new = {row.metric for row in rows if row.method == "newton-1" and row.status == "ok"}
    assert "energy/total" in new and not any(metric.startswith("distance/") for metric in new)
    assert execution.execute(dataclasses.replace(missing, only=frozenset({"stale", "missing"}))) == 0
    rows = RunFolder(tmp_path).read_rows()
    assert any(row.metric == "distance/rms" and row.method == "newton-1" for row in rows)
    assert not any("kept" in row.reason for row in rows)


# --- interrupts and kills --------------------------------------------------------------------------------


def test_an_interrupted_continuation_keeps_the_rows_of_what_is_finished(tmp_path, monkeypatch, capsys):
    options = words_of(tmp_path, "simulation,newton-4")
    assert run.main(options) == 0
    before = RunFolder(tmp_path).read_rows()
    (tmp_path / "cache" / "metrics" / "free_fall" / "newton-4.json").unlink()
    with monkeypatch.context() as patch:
        interrupt_at("newton-1", patch)
        assert run.main(words_of(tmp_path, "simulation,newton-1,newton-4")) == 130
    assert "interrupted" in capsys.readouterr().err
    assert RunFolder(tmp_path).read_config()["interrupted"] is True
    assert not [path for path in tmp_path.rglob("*") if ".part" in path.name]
    assert RunFolder(tmp_path).read_rows() == [row for row in before if row.method == "simulation"]
    assert run.main(options) == 0 and RunFolder(tmp_path).read_rows() == before


def test_an_interrupt_before_anything_is_known_leaves_the_last_table(tmp_path, monkeypatch):
    options = words_of(tmp_path, "simulation")
    assert run.main(options) == 0
    before = RunFolder(tmp_path).read_rows()

    def interrupt(self, executor, log):
        raise KeyboardInterrupt

    monkeypatch.setattr(Runner, "run", interrupt)
    assert run.main([*options, "--fresh"]) == 130
    assert before and RunFolder(tmp_path).read_rows() == before


def test_an_interrupt_knows_which_simulations_have_failed(tmp_path):
    scene = of_garment("tshirt").scene("kick").at(TINY)
    cell = Cell(scene, find_method("supervised"), 0, ("garments",))
    motions = Motions(train=("walk", "run"), test=("kick",))
    plan = plan_of(tmp_path, motions=motions, cells=(cell,))
    cache, entries = Cache(RunFolder(tmp_path)), {}
    by_id = {t.id: t for t in tasks_of(plan)}
    lost = Outcome("diverged", "far away", failed=True)
    killed = Outcome("failed", "killed", failed=True)
    network = Schedule(plan).network(Network("supervised", 0, "tshirt")).id
    for id, outcome in (
        (("start", "tshirt-kick"), Outcome()), (("data", "tshirt-walk/simulation"), Outcome()),
        (("data", "tshirt-run/simulation"), lost), (network, Outcome()), (("cell", cell.name), killed),
    ):  # fmt: skip
        entries[id] = cache.keep(by_id[id], outcome, entries)
    runner = Runner(tasks_of(plan), Cache(RunFolder(tmp_path)))
    (row,) = rows_of(plan, runner.tasks, runner.known())
    assert (row.method, row.status, row.reason) == ("supervised", "failed", "killed")
    assert runner.outcomes["data", "tshirt-run/simulation"].reason == "far away"
    assert found_of(plan).state == "failed"


def test_the_longest_training_begins_first(tmp_path):
    options = ["full:garments", "--methods", "pbns,snug,ncs,handles-20", "-o", str(tmp_path)]
    plan = planned(*options)
    trainings = [task for task in tasks_of(plan) if task.kind == "network"]
    assert [batch[0].label.split()[0] for batch in _batches(trainings)] == [
        "ncs",
        "snug",
        "pbns",
        "handles-20",
    ]
