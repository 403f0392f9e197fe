"""Tasks and what may happen to them: fail, hang, be killed, be damaged; and what the next run does then."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Executor, TaskProcess
from benchmarks.runner.loop import Runner
from benchmarks.runner.progress import Progress
from benchmarks.runner.task import Task
from tests.benchmarks.runner.processes_by_hand import alive, finish, ids, task, together, until
from tests.benchmarks.runner.tasks_by_hand import InProcess


def statuses(runner: Runner) -> dict[str, str]:
    return {name: outcome.status for (_, name), outcome in runner.outcomes.items()}


EVENTS = [
    ("raise", "failed", "ValueError: broken on purpose", ""),
    ("die", "out-of-memory", "SIGKILL: the system was out of memory", "its own"),
    ("hang", "timeout", "no answer within 0.5 s", "its own"),
    ("interrupt", "failed", "KeyboardInterrupt", ""),
    ("cold", "out-of-memory", "MemoryError: no room to compile", ""),
    ("float32", "failed", "float32", "its own"),
    ("nowhere", "failed", "nowhere.txt", ""),
    ("torch", "out-of-memory", "DefaultCPUAllocator", ""),
]


@pytest.mark.parametrize(("how", "status", "words", "process"), EVENTS)
def test_a_failure_is_kept_blocks_what_needs_it_and_is_done_again_when_asked(
    how, status, words, process, tmp_path
):
    def tasks(how: str = "") -> list[Task]:
        return [
            task("bad", how, process=process), task("needs", needs=ids("bad"), process=process),
            task("reads", reads=ids("bad")), task("other", process=process),
        ]  # fmt: skip

    first = finish(tmp_path, *tasks(how))
    assert statuses(first) == {"bad": status, "needs": "failed", "reads": "ok", "other": "ok"}
    bad, needs = (first.outcomes["network", name] for name in ("bad", "needs"))
    assert bad.failed and words in bad.reason and "\n" not in bad.reason
    assert needs.reason == f"cannot be run: network bad: {status}: {bad.reason}"
    assert (tmp_path / "reads.txt").read_text() == "reads"
    assert first.broken() == [f"network bad: {bad.ending}", f"network needs: {needs.ending}"]

    second = finish(tmp_path, *tasks())  # it would succeed now
    assert statuses(second) == statuses(first)
    assert sorted(second.reused) == ["network bad", "network other", "network reads"]

    third = finish(tmp_path, *tasks(), retry=True)
    assert set(statuses(third).values()) == {"ok"} and third.reused == ["network other"]
    for name in ("needs", "reads"):
        assert (tmp_path / f"{name}.txt").read_text() == f"bad{name}"


def test_a_dry_run_decides_as_the_run_does(tmp_path):
    """A dry run foresees every decision of the run except those that follow from a failure."""

    def planned_and_done(how: str, **options) -> tuple[set[str], set[str]]:
        tasks = (
            task("first", how), task("second", needs=ids("first")), task("third", reads=ids("first")),
            task("fourth"),
        )  # fmt: skip
        preview = Runner(tasks, Cache(RunFolder(tmp_path), **options)).preview()
        planned = {task.name for task, _, outcome in preview if outcome is None}
        runner = finish(tmp_path, *tasks, **options)
        names = {name for (_, name), outcome in runner.outcomes.items() if outcome.content}
        return planned, names - {title.split()[1] for title in runner.reused}

    everything = {"first", "second", "third", "fourth"}
    assert planned_and_done("raise") == (everything, everything - {"second"})
    assert planned_and_done("raise") == (set(), set())
    (tmp_path / "fourth.txt").unlink()
    assert planned_and_done("raise") == ({"fourth"}, {"fourth"})
    assert planned_and_done("", retry=True) == (everything - {"fourth"},) * 2


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("first.txt", "damaged", "missing: first.txt is damaged"),
        ("first.txt", None, "missing: first.txt is gone"),
        ("cache/network/first.json", "{", "missing: its entry is damaged or of another version"),
    ],
)
def test_what_is_damaged_is_done_again_alone_where_it_comes_back_as_it_was(tmp_path, name, text, why):
    tasks = task("first"), task("second", needs=ids("first")), task("third")
    finish(tmp_path, *tasks)
    assert len(finish(tmp_path, *tasks).reused) == 3
    (tmp_path / name).unlink() if text is None else (tmp_path / name).write_text(text)
    assert Cache(RunFolder(tmp_path)).find(tasks[0], {}) == (why, None)
    runner = finish(tmp_path, *tasks)
    assert (tmp_path / "first.txt").read_text() == "first"
    assert sorted(runner.reused) == ["network second", "network third"]


class TwoAtOnce(InProcess):
    """Two workers, of which the one that began first ends first; writes down what is at work at a time."""

    def __init__(self, folder: RunFolder) -> None:
        super().__init__(folder)
        self.at_work: list[list[str]] = []

    def together(self, ready):
        begun = []
        while True:
            while len(begun) < 2 and (batch := ready()):
                begun.append(batch)
            if not begun:
                return
            self.at_work.append([task.name for tasks, _ in begun for task in tasks])
            tasks, needed = begun.pop(0)
            for each in tasks:
                yield each, each.run(self.context(), needed)

    def run_alone(self, task, needed):
        self.at_work.append([task.name])
        return super().run_alone(task, needed)


def test_a_task_begins_when_its_needs_are_there_and_nothing_is_beside_a_timed_task(tmp_path):
    tasks = (
        task("short"), task("long", work=5.0), task("next", needs=ids("short", "long")),
        task("timed", needs=ids("next"), process="own"),
        task("after", needs=ids("timed")), task("one", needs=ids("short"), batch="both"),
        task("two", needs=ids("long"), batch="both"), task("three", needs=ids("next")),
    )  # fmt: skip
    folder = RunFolder(tmp_path)
    runner, executor = Runner(tasks, Cache(folder)), TwoAtOnce(folder)
    runner.run(executor)
    assert executor.at_work == [
        ["long", "short"], ["short"], ["one", "two", "next"], ["next"], ["three"], ["timed"], ["after"],
    ]  # fmt: skip
    assert set(statuses(runner).values()) == {"ok"}


def test_a_batch_stays_together_and_nothing_is_kept_between_batches(tmp_path):
    hows = {"one": "", "two": "", "bad": "raise", "four": ""}
    batch = [task(name, how, batch="first") for name, how in hows.items()]
    outcomes = together(tmp_path, batch, [task("three")])
    memos = {name: outcome.result.get("memo") for name, outcome in outcomes.items()}
    assert memos == {
        "one": ["one"], "two": ["one", "two"], "bad": None, "four": ["one", "two", "four"],
        "three": ["three"],
    }  # fmt: skip


def test_a_named_process_is_kept_until_it_is_released(tmp_path):
    executor = Executor(RunFolder(tmp_path), None, 1)
    first, second = (task(name, process="own") for name in ("first", "second"))
    try:
        assert executor.run_alone(first, {}).result["memo"] == ["first"]
        assert executor.run_alone(second, {}).result["memo"] == ["first", "second"]
        executor.release("own")
        assert executor.run_alone(second, {}).result["memo"] == ["second"]
    finally:
        executor.close()


def test_what_a_task_has_started_ends_when_its_time_is_up(tmp_path):
    process = TaskProcess(RunFolder(tmp_path), None)
    outcome = process.do(task("one", "leave"), {})
    assert outcome.status == "timeout"
    until(lambda: not alive(int(outcome.reason)), 5.0)
    assert process.do(task("two"), {}).result["memo"] == ["two"]
    process.close()


def test_the_time_left_never_grows_and_a_stage_begins_with_a_line(capsys):
    tasks = [
        Task(kind="cell", name=str(n), label="", stage=f"part {n // 5}", run=print) for n in range(10)
    ]
    progress, times = Progress(tasks, workers=2), []
    for each, seconds in zip(tasks, (0.1, 90.0, 3.0, 0.0, 400.0, 0.2, 1.0, 1.0, 700.0, 0.1)):
        progress.begin(each)
        progress.time_left()
        times.append(progress.shown)
        progress.end(each, seconds)
    assert times == sorted(times, reverse=True) and times[-1] < times[0]
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(";")[0] for line in lines] == ["part 0: 5 tasks", "part 1: 5 tasks"]


FEATURES = (
    "import reference_sim.kernels.kernel_cache\nfrom numba.core.registry import cpu_target\n"
    "print(cpu_target.target_context.codegen().magic_tuple()[2])"
)
TASK = f"""from benchmarks.runner.isolated_process import start_loading
(process := start_loading().Process(target=exec, args=({FEATURES!r},))).start()
process.join()"""


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="LLVM chooses the width there")
def test_tasks_sum_up_in_vectors_of_the_width_that_the_run_names():
    variables = {k: v for k, v in os.environ.items() if k != "NUMBA_CPU_FEATURES"}
    lines = [subprocess.check_output([sys.executable, "-c", c], env=variables) for c in (FEATURES, TASK)]
    assert lines[0] == lines[1] and lines[0].endswith(b",+prefer-256-bit\n")
