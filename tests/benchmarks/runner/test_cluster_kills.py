"""A cluster some of whose processes are killed: nothing that was finished is lost or done again."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import threading
import time
from contextlib import nullcontext, suppress

import pytest

from tests.benchmarks.runner.cluster_by_hand import (
    Dask,
    alive,
    cluster,
    files,
    finish,
    lines,
    start_runner,
    together,
    until,
    write,
)

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow
KILLS = int(os.environ.get("KILLS", "20"))  # of the processes here, and as many of the cluster


def test_a_task_that_three_workers_died_of_has_failed_and_the_others_go_on(folder, tmp_path):
    with cluster(tmp_path, 4) as four:
        batch = [write("deadly", how="die with the worker"), write("after")]
        outcomes = together(folder, four.address, batch, [write("beside")])
    assert outcomes["deadly"].failed and outcomes["deadly"].reason.startswith(
        "3 workers died while they did it: "
    )
    assert outcomes["after"].status == outcomes["beside"].status == "ok"


def test_workers_behind_a_nanny_come_back(folder, tmp_path):
    with cluster(tmp_path, 0) as none:
        none.add("--nanny")
        batch = [write("deadly", how="die with the worker"), write("after")]
        outcomes = together(folder, none.address, batch)
    assert outcomes["deadly"].failed and outcomes["after"].status == "ok"


def test_an_interrupt_ends_what_the_cluster_does_and_leaves_the_cluster(folder, tmp_path, request):
    mark = tmp_path / "mark"

    def interrupt():
        until(lambda: len(lines(mark)) == 2)
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    threading.Thread(target=interrupt).start()
    batches = [[write(f"{n}", sleep=60.0, mark=str(mark))] for n in range(4)]
    with cluster(tmp_path, 2) as two:
        with pytest.raises(KeyboardInterrupt):
            together(folder, two.address, *batches)
        until(lambda: not any(alive(task) for _, task in lines(mark)), 10.0)
        assert len(lines(mark)) == 2 and not list(folder.path.rglob(".*"))
        assert together(folder, two.address, [write("after")])["after"].status == "ok"


def test_what_a_killed_runner_had_begun_is_ended(folder, tmp_path):
    mark = tmp_path / "mark"
    with cluster(tmp_path, 2) as two:
        runner = start_runner(folder.path, two.address, seconds=60.0, mark=mark)
        until(lambda: len(lines(mark)) == 2)
        runner.kill()
        runner.wait()
        until(lambda: not any(alive(task) for _, task in lines(mark)), 10.0)
        assert together(folder, two.address, [write("after")])["after"].status == "ok"


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("expected")
    finish(folder)
    return files(folder)


def test_with_a_worker_killed_and_the_scheduler_restarted_the_files_are_the_same(folder, tmp_path, expected):
    with cluster(tmp_path, 2) as two:
        mark = tmp_path / "mark"
        runner = start_runner(folder.path, two.address, seconds=1.0, mark=mark)
        until(lambda: len(lines(mark)) >= 3)
        os.kill(lines(mark)[-1][0], signal.SIGKILL)
        two.add()
        until(lambda: len(list(folder.path.rglob("*.json"))) >= 5)
        two.restart_scheduler()
        two.add()
        two.add()
        assert runner.wait(180) == 0
    assert files(folder.path) == expected


@pytest.mark.parametrize("workers", [0, 2])
def test_killed_at_random_moments_the_files_are_the_same(folder, tmp_path, expected, workers):
    """The runner, or a worker; here a task's process. What was finished is done no second time."""
    chance, kills, mark = random.Random(7), 0, tmp_path / "mark"
    with cluster(tmp_path, workers) if workers else nullcontext() as dask_cluster:
        address = dask_cluster.address if dask_cluster else ""
        while kills < KILLS:
            runner = start_runner(folder.path, address, seconds=0.3, mark=mark)
            while kills < KILLS and runner.poll() is None:
                begun = len(lines(mark))
                until(lambda: len(lines(mark)) > begun or runner.poll() is not None)  # noqa: B023
                time.sleep(chance.uniform(0.0, 0.6))
                if runner.poll() is not None:
                    break
                kept = {path: path.read_bytes() for path in folder.path.glob("cache/**/*.json")}
                kill_one(chance, dask_cluster, runner, lines(mark)[-1][1])
                kills += 1
                assert {path: path.read_bytes() for path in kept} == kept
            runner.wait(120)
            if files(folder.path) == expected:  # begin again: there are kills left
                for path in folder.path.rglob("*.json"):
                    path.unlink()
        finish(folder.path, address)
    assert files(folder.path) == expected
    until(lambda: not any(alive(task) for _, task in lines(mark)), 15.0)


def kill_one(chance: random.Random, dask_cluster: Dask | None, runner: subprocess.Popen, task: int) -> None:
    if chance.random() < 0.5:
        runner.kill()
        runner.wait()
    elif dask_cluster is None:
        with suppress(ProcessLookupError):  # it has just ended with the chain
            os.kill(task, signal.SIGKILL)
    else:
        victim = dask_cluster.workers.pop(chance.randrange(len(dask_cluster.workers)))
        victim.kill()
        victim.wait()
        dask_cluster.add()
