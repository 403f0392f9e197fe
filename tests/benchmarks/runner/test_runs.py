"""A run's folder: one run at a time, whole after an interrupt or a kill; and cases, each once."""

from __future__ import annotations

import dataclasses
import os
import shutil
import signal
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import RunLog
from benchmarks.validation.case import Case
from benchmarks.validation.registry import KNOWN_ANSWERS
from tests.benchmarks.runner.processes_by_hand import task
from tests.benchmarks.runner.tasks_by_hand import InProcess, finish, plan_of, run_in_this_process

WORDS = ["smoke:speed", "--scenes", "free_fall"]


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    run_in_this_process(monkeypatch)


def words_of(folder: Path, methods: str) -> list[str]:
    return [*WORDS, "-o", str(folder), "--methods", methods]


def test_a_second_run_in_the_same_folder_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    options, answers = words_of(tmp_path / "run", "simulation"), []

    def execute(plan, assets):
        if not answers:
            answers.append(None)
            capsys.readouterr()
            answers.append(run.main(options))
        return 0

    monkeypatch.setattr(execution, "execute", execute)
    assert run.main(options) == 0 and answers == [None, 2]
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "another run" in error and str(tmp_path / "run") in error
    assert run.main(options) == 0  # the first has ended
    assert not list((tmp_path / "run").iterdir())  # nothing was written there


def test_what_a_killed_run_was_writing_is_removed_and_a_fresh_one_goes_on_from_no_training(tmp_path):
    scene, models = tmp_path / "trajectories" / "free_fall", tmp_path / "models" / "tunic"
    for folder in (scene, models):
        folder.mkdir(parents=True)
    for name in ("simulation.vtkhdf", "newton-1.vtkhdf.part", ".body.77.part.npy"):
        (scene / name).write_bytes(b"half")
    stopped = models / ".snug-seed0.checkpoint.safetensors"
    stopped.write_bytes(b"half")
    plan = plan_of(tmp_path)
    RunLog(plan)
    assert [path.name for path in scene.iterdir()] == ["simulation.vtkhdf"] and stopped.is_file()
    RunLog(dataclasses.replace(plan, fresh=True))
    assert not stopped.exists()


def test_an_interrupt_leaves_the_table_and_what_is_finished(tmp_path, monkeypatch, capsys):
    options = words_of(tmp_path, "simulation,newton-4")
    assert run.main(options) == 0
    before, alone = RunFolder(tmp_path).read_rows(), InProcess.run_alone

    def interrupted(self, task, needed):
        if " x newton-1" in task.label:
            raise KeyboardInterrupt
        return alone(self, task, needed)

    with monkeypatch.context() as patch:
        patch.setattr(InProcess, "run_alone", interrupted)
        assert run.main(words_of(tmp_path, "simulation,newton-1,newton-4")) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not [path for path in tmp_path.rglob("*") if ".part" in path.name]
    assert before and RunFolder(tmp_path).read_rows() == before
    assert run.main(options) == 0 and RunFolder(tmp_path).read_rows() == before


def test_a_failed_task_that_no_row_speaks_of_makes_the_exit_status_1(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(execution, "tasks_of", lambda plan: [task("lame", "raise")])
    assert execution.execute(plan_of(tmp_path)) == 1
    assert "network lame: failed: ValueError: broken on purpose" in capsys.readouterr().err


WORN = "trajectories/tshirt-sudden_stop"
DRESSED = ["smoke:garments", "--scenes", "tshirt/sudden_stop"]
DRESSED += ["--methods", "simulation,skinning,supervised-vertices,snug"]


def run_dressed(folder: Path) -> dict:
    """Run the command into `folder` and return its rows without costs and measured times."""
    assert run.main([*DRESSED, "-o", str(folder)]) == 0
    rows = RunFolder(folder).read_rows()
    untimed = [
        row for row in rows if not row.metric.startswith("cost/") and row.unit not in ("s", "ms", "MB")
    ]
    return {(r.method, r.metric, r.seed): (r.value, r.status, r.reason, r.uncertainty) for r in untimed}


@pytest.fixture(scope="module")
def dressed(tmp_path_factory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("dressed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(execution, "make_report", lambda log: "")
        return folder, run_dressed(folder)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        f"{WORN}/settled.npy", f"{WORN}/body.vtkhdf",
        f"{WORN}/simulation.vtkhdf", f"{WORN}/quasi-static.vtkhdf", f"{WORN}/snug.npz",
        f"{WORN}/snug-quasi-static.vtkhdf", "trajectories/tshirt-07_01/simulation.vtkhdf",
        "models/supervised-vertices-seed0.safetensors",
    ],
)  # fmt: skip
def test_every_kind_of_kept_file_is_made_again_and_the_numbers_are_the_same(dressed, tmp_path, name):
    folder = shutil.copytree(dressed[0], tmp_path / "run")
    digests = RunFolder(folder).read_config()["digests"]
    data = bytearray((folder / name).read_bytes())
    data[len(data) // 2] ^= 16
    (folder / name).write_bytes(data)
    assert RunFolder(folder).find_changes(digests) == {name: "damaged"}
    assert run_dressed(folder) == dressed[1]
    config = RunFolder(folder).read_config()
    assert set(config["digests"]) == set(digests) and not RunFolder(folder).find_changes(
        config["digests"]
    )


def warmth() -> float:
    """Return how often the process was warmed up."""
    return float(os.environ.get("WARM", "0"))


def warm_up() -> None:
    os.environ["WARM"] = str(warmth() + 1)


def hang() -> None:
    signal.pause()


def case(function: str, seconds: float = 60.0, **declared) -> Case:
    return Case(
        name=function, suite="extremes", description="", module=__name__, function=function, seconds=seconds,
        metric="outcome", **declared,
    )  # fmt: skip


def rows_of_cases(folder, *cases: Case, processes: bool = False):
    plan = plan_of(folder, cases=cases)
    runner = finish(plan, "known answers", processes=processes)
    return rows_of(plan, runner.tasks, runner.outcomes), runner


def test_what_did_not_come_back_is_a_failed_row_and_the_next_case_is_run(tmp_path):
    cases = case("hang", 0.5, expected=0.0), case("warmth"), case("absent")
    (hung, next_one, absent), _ = rows_of_cases(tmp_path, *cases, processes=True)
    assert (hung.status, hung.value, hung.expected) == ("failed", None, 0.0)
    assert "no answer within 0.5 s" in hung.reason
    assert (next_one.status, next_one.value) == ("ok", 1.0)  # a new process is warmed up anew
    assert (absent.status, absent.value) == ("failed", None) and "AttributeError" in absent.reason


def test_a_case_is_computed_once_and_again_when_it_declares_something_else(tmp_path):
    answer = next(c for c in KNOWN_ANSWERS if c.smoke and c.tolerance is not None)
    first, runner = rows_of_cases(tmp_path, answer)
    assert runner.reused == []
    again, runner = rows_of_cases(tmp_path, answer)
    assert again == first and runner.reused == [f"case {answer.name}"]
    off = dataclasses.replace(answer, expected=(answer.expected or 0.0) + 1e6, tolerance=1e-9)
    (failed,), runner = rows_of_cases(tmp_path, off)
    assert failed.status == "failed" and runner.reused == []
    assert f"case {answer.name}: cached (failed: " in execution.describe(plan_of(tmp_path, cases=(off,)))
