"""The schedule simulated for many workers: known answers, and what it reads of a run."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import scaling
from benchmarks.results.run_folder import FORMAT, RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.scaling import Costs, Measured, outlook, stage_seconds, study
from benchmarks.tasks.ground_truth import SimulateMotion
from benchmarks.tasks.sequence import SimulateSequence
from benchmarks.tasks.task import Outcome

FREE = Costs(start=0.0, handling=0.0, bandwidth=np.inf)


def tasks(*seconds: float, megabytes: float = 0.0, timed: bool = False, stage: str = "a") -> list[Measured]:
    return [Measured(stage, own, megabytes, timed) for own in seconds]


@pytest.mark.parametrize(("workers", "wall"), [(1, 12.0), (2, 6.0), (3, 4.0), (4, 4.0), (6, 2.0), (99, 2.0)])
def test_equal_tasks_take_whole_rounds(workers, wall):
    assert stage_seconds(tasks(*[2.0] * 6), workers, FREE) == wall


def test_the_longest_task_bounds_the_wall_time_and_is_named():
    found = outlook(tasks(100.0, *[1.0] * 100), 50, FREE)
    assert found.seconds == 100.0 and found.efficiency == pytest.approx(200.0 / 5000.0)
    assert found.held_by == "the longest task of each stage"


def test_the_longest_go_first():
    """5+3 beside 4+3+3; in the order given it would be 11 seconds."""
    assert stage_seconds(tasks(3.0, 3.0, 3.0, 4.0, 5.0), 2, FREE) == 10.0


def test_one_runner_serves_all_workers():
    short = tasks(*[0.001] * 1000, megabytes=10.0)
    costs = Costs(start=0.0, handling=0.02, bandwidth=100.0)
    found = outlook(short, 10_000, costs)
    assert found.seconds == pytest.approx(1000 * 0.12, rel=0.01)
    assert found.held_by == "the runner, which takes every result"


def test_timed_cells_run_alone_and_stages_one_after_another():
    both = [*tasks(8.0, 8.0), *tasks(4.0, 4.0, stage="b"), *tasks(5.0, 5.0, timed=True, stage="c")]
    assert outlook(both, 2, FREE).seconds == 8.0 + 4.0 + 10.0
    assert outlook(both, 1, FREE).efficiency == 1.0


def test_workers_start_once():
    both = [*tasks(8.0), *tasks(4.0, stage="b")]
    assert outlook(both, 1, Costs(start=20.0, handling=0.0, bandwidth=1.0)).seconds == 32.0


def test_a_study_draws_from_what_was_measured():
    some = [*tasks(1.0, 2.0, 3.0), *tasks(50.0, stage="b")]
    many = study(some, 200, np.random.default_rng(0))
    assert len(many) == 800 and set(many) == set(some)
    mean = np.mean([task.seconds for task in many if task.stage == "a"])
    assert mean == pytest.approx(2.0, abs=4 * 0.816 / np.sqrt(600))
    assert study(some, 1, np.random.default_rng(0)) == some


def finished(
    folder: RunFolder, name: str, seconds: float, *, kind=SimulateMotion, failed=False, process=""
) -> None:
    """The entry of a task in the cache, with a file of two megabytes."""
    path = folder.path / f"{name}.bin"
    path.write_bytes(bytes(2_000_000))
    task = kind(name=name, label=name, inputs={}, modules=(), scene=None, entry=None, process=process)
    Cache(folder).keep(task, Outcome(seconds=seconds, failed=failed, files=(path.name,)), {})


def test_a_run_is_read_and_tabulated(tmp_path, capsys):
    folder = RunFolder(tmp_path)
    finished(folder, "one", 3.0)
    finished(folder, "two", 5.0, process="of its own")
    finished(folder, "three", 9.0, failed=True)
    found = scaling.measured(folder)
    assert [(t.stage, t.seconds, t.megabytes, t.timed) for t in found] == [
        ("ground truth", 3.0, 2.0, False), ("ground truth", 5.0, 2.0, True),
    ]  # fmt: skip
    out = tmp_path / "scaling.csv"
    assert scaling.main([str(tmp_path), "--copies", "10", "--workers", "1,4", "-o", str(out)]) == 0
    assert "20 tasks" in capsys.readouterr().out
    assert [line.split(",")[0] for line in out.read_text().splitlines()] == ["workers", "1", "4"]


def test_a_data_set_is_read_too(tmp_path):
    finished(RunFolder(tmp_path), "one", 3.0, kind=SimulateSequence)
    assert [t.seconds for t in scaling.measured(RunFolder(tmp_path), ["sequence"])] == [3.0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "no finished task of this version"),
        (["--kinds", "dta"], "no task of kind 'dta'"),
        (["--workers", "0"], "posi"),
        (["--workers", "1,x"], "--workers 1,x: give whole numbers"),
        (["--handling", "-0.9"], "--start and --handling are seconds"),
        (["--start", "nan"], "--start and --handling are seconds"),
    ],
)
def test_what_cannot_be_simulated_is_one_line(tmp_path, capsys, monkeypatch, options, words):
    with monkeypatch.context() as before:
        before.setattr("benchmarks.runner.cache.FORMAT", FORMAT - 1)
        finished(RunFolder(tmp_path), "one", 3.0)
    assert scaling.main([str(tmp_path), *options]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
