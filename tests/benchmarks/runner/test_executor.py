"""Processes of this machine: outcomes of all tasks, a failure as a value, progress whatever dies."""

from __future__ import annotations

import operator
import os
import signal
import sys
import time
from contextlib import closing
from functools import partial

import pytest

from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cells import loaded
from benchmarks.runner.executor import Executor
from benchmarks.runner.isolated_process import LOADED_BY_ALL, IsolatedProcess, WorkerDied
from benchmarks.runner.task import Outcome, RunStopped, Task
from tests.benchmarks.runner.tasks_by_hand import Bar
from tests.project.own_memory import needs_proc, own_memory

HELD: list[bytearray] = []  # of a process


def begin(name, how, context):
    if how == "die at once":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "raise":
        raise OSError("no such body")
    context.memo["done"] = [f"{name} begun beside {others(name, context.folder.path)}"]


def others(name, folder) -> int:
    """Return how many other tasks have begun: wait for the first, at most 10 s."""
    (folder / name).touch()
    for _ in range(100):
        if (count := len(list(folder.iterdir())) - 1) > 0:
            return count
        time.sleep(0.1)
    return 0


def warm_up():
    raise MemoryError("no room to compile")


def run(name, terms, how, context, needed):
    if how == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "hang":
        signal.pause()
    if how == "stop":
        raise RunStopped("the disk is full")
    if how == "fill":
        pieces: list = [bytearray(50_000) for _ in range(3000)]  # each too small to be mapped by itself
        HELD.append(bytearray(50_000))  # while it is there the heap does not shrink by itself
        pieces.append(pieces)  # freed only by who looks for circles
        del pieces
    context.tell(0.5)
    context.memo.setdefault("done", []).append(name)
    first, second = terms
    return Outcome(result={"sum": first + second, "memo": list(context.memo["done"]), "kB": own_memory()})


def add(name: str, terms=(1, 2), how: str = "", **fields) -> Task:
    return Task(
        kind="sum", name=name, label=name, stage="adding", run=partial(run, name, terms, how),
        begin=partial(begin, name, how), warm_up=warm_up if how == "cold" else None,
        code=("benchmarks/results",), **fields,
    )  # fmt: skip


def together(folder, *batches, workers: int = 1) -> tuple[dict[str, Outcome], Bar]:
    bar = Bar()
    left = [(batch, {}) for batch in reversed(batches)]
    executor = Executor(RunFolder(folder), None, workers)
    done = executor.together(lambda: left.pop() if left else None, bar)
    return {task.name: outcome for task, outcome in done}, bar


def test_a_task_that_hangs_is_ended_at_its_deadline(tmp_path):
    outcomes, _ = together(tmp_path, [add("hangs", how="hang", deadline=0.5)], [add("after")])
    assert outcomes["hangs"].status == "timeout" and "0.5 s" in outcomes["hangs"].reason
    assert outcomes["after"].result["sum"] == 3


def test_what_cannot_be_made_ready_is_a_failure(tmp_path):
    outcomes, _ = together(tmp_path, [add("cold", how="cold")], [add("after")])
    assert outcomes["cold"].status == "out-of-memory" and "no room to compile" in outcomes["cold"].reason
    assert outcomes["after"].result["sum"] == 3


def test_a_batch_stays_together_and_nothing_is_kept_between_batches(tmp_path):
    batch = [add("one"), add("two"), add("bad", terms=(1, "x")), add("four")]
    outcomes, _ = together(tmp_path, batch, [add("three")])
    assert outcomes["two"].result["memo"] == ["one", "two"] and outcomes["three"].result["memo"] == ["three"]
    assert outcomes["bad"].failed and outcomes["four"].result["memo"] == ["one", "two", "bad", "four"]


def test_what_was_finished_is_kept_where_the_run_stops(tmp_path):
    batches = [([add("one"), add("stops", how="stop"), add("after")], {})]
    executor, kept = Executor(RunFolder(tmp_path), None, 1), []
    with pytest.raises(RunStopped, match="the disk is full"):
        for task, _ in executor.together(lambda: batches.pop() if batches else None, Bar()):
            kept.append(task.name)
    assert kept == ["one"]


def test_a_worker_has_its_next_batch_before_outcomes_of_others_are_kept(tmp_path):
    """The one thread that keeps outcomes holds up no worker: of many, all would wait for it."""
    left, handed_out = [([add(name)], {}) for name in "dcba"], []

    class Instant:
        slots = 2

        def do(self, task, needed, batch, told):
            return Outcome()

        def rest(self):
            pass

    def ready():
        if left:
            handed_out.append(left[-1][0][0].name)
        return left.pop() if left else None

    executor = Executor(RunFolder(tmp_path), None, 1, Instant())
    for number, _ in enumerate(executor.together(ready, Bar()), 1):
        time.sleep(0.05)  # until those at work have ended
        assert len(handed_out) >= min(number + 1, 4)


@pytest.mark.slow
@needs_proc
def test_free_memory_of_a_batch_is_given_back(tmp_path):
    outcomes, _ = together(tmp_path, [add("one", how="fill"), add("two")], [add("three")])
    during, after = (outcomes[name].result["kB"] for name in ("two", "three"))
    assert during - after > 100_000


def test_a_named_process_is_kept_until_it_is_released(tmp_path):
    alone = Executor(RunFolder(tmp_path), None, 1)
    try:
        first, second = (add(name, process="own") for name in ("first", "second"))
        assert alone.alone(first, {}).result["memo"] == ["first"]
        assert alone.alone(second, {}).result["memo"] == ["first", "second"]
        alone.release("own")
        assert alone.alone(second, {}).result["memo"] == ["second"]
    finally:
        alone.close()


@pytest.mark.slow
def test_timed_tasks_begin_side_by_side_and_what_goes_wrong_there_is_their_outcome(tmp_path):
    two = Executor(RunFolder(tmp_path), None, 2)
    tasks = [
        add("one", process="a"), add("other", process="b"),
        add("dies", process="c", how="die at once"), add("raises", process="d", how="raise", terms=(1, "x")),
    ]  # fmt: skip
    try:
        two.begin([(task, {}) for task in tasks])
        one, other, dies, raises = (two.alone(task, {}) for task in tasks)
        assert one.result["memo"] == ["one begun beside 1", "one"]
        assert other.result["memo"] == ["other begun beside 1", "other"]
        assert dies.status == "out-of-memory" and "SIGKILL" in dies.reason
        assert raises.reason.startswith("TypeError")
        assert two.alone(add("dies", process="c"), {}).result["memo"] == ["dies"]  # in a new process
    finally:
        two.close()


@pytest.mark.slow
def test_a_hang_and_a_crash_are_ended_and_the_next_work_is_done():
    with closing(IsolatedProcess()) as process:
        assert process.call(operator.mul, 2, 4, seconds=60) == 8
        began = time.monotonic()
        with pytest.raises(WorkerDied, match=r"no answer within 0\.2 s"):
            process.call(time.sleep, 1000, seconds=0.2)
        assert time.monotonic() - began < 4.0
        with pytest.raises(WorkerDied, match="ended with status 7"):
            process.call(os._exit, 7, seconds=60)
        with pytest.raises(ValueError, match="invalid literal"):
            process.call(int, "x", seconds=60)
        assert process.call(operator.mul, 2, 5, seconds=60) == 10


def interrupt():
    raise KeyboardInterrupt("by the work itself")


def test_an_interrupt_that_the_work_raises_is_a_failure_of_the_work():
    with closing(IsolatedProcess()) as process:
        with pytest.raises(WorkerDied, match="KeyboardInterrupt: by the work itself"):
            process.call(interrupt, seconds=60)
        assert process.call(operator.mul, 2, 4, seconds=60) == 8


def test_a_process_that_cannot_start_is_none_at_all():
    with closing(IsolatedProcess(lambda: None)) as process:  # cannot be sent to it
        for _ in range(2):
            with pytest.raises(Exception, match="lambda"):
                process.call(operator.mul, 2, 4, seconds=1)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere each process loads its own")
def test_a_process_begins_with_what_all_need_and_nothing_that_a_scene_may_do_without():
    with closing(IsolatedProcess()) as process:
        there = set(process.call(loaded, seconds=60))
    assert there.issuperset({"h5py", "numba", "scipy", *LOADED_BY_ALL} - {"scipy.sparse.linalg"})
    assert not [name for name in there if name.startswith(("snug", "torch", "igl"))]
