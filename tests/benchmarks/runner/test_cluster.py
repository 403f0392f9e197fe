"""A cluster gives what this machine gives, whatever of it dies; and what cannot work is said in one line."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from contextlib import nullcontext, suppress
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import cluster as scheduler
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.task import RunRefused, RunStopped
from snug.networks.tensor_file import read_tensors
from tests.benchmarks.runner.processes_by_hand import Dask, alive, chain, finish, task, together, until

pytest.importorskip("distributed")
KILLS = int(os.environ.get("KILLS", "10"))  # of the processes here, and as many of the cluster


def files(folder: Path) -> dict[str, str]:
    """Name -> text, of what is whole and of what is not."""
    return {path.name: path.read_text() for path in sorted(folder.rglob("*.txt"))}


@pytest.mark.slow
def test_a_run_on_a_cluster_is_that_of_this_machine(tmp_path, monkeypatch):
    """Bit for bit, but for times: a network that learned from ground truth, and metrics of all frames."""
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    options = ["smoke:garments", "--set", "split=validation"]
    options += ["--scenes", "tshirt/sudden_stop", "--methods", "simulation,supervised-vertices"]

    def kept(name: str, *more: str) -> tuple[dict, dict]:
        """Run; return all numbers but costs, and the weights of the network."""
        folder = RunFolder(tmp_path / name)
        assert run.main([*options, "-o", str(folder.path), *more]) == 0
        rows = [row for row in folder.read_rows() if not row.metric.startswith("cost/")]
        weights = read_tensors(folder.models / "supervised-vertices-seed0.safetensors")[0]
        return (
            {
                (row.scene, row.method, row.metric): (row.value, row.uncertainty, row.status)
                for row in rows
            },
            {name: tensor.numpy().tobytes() for name, tensor in weights.items()},
        )

    with Dask(tmp_path, 2) as started:
        assert kept("there", "--scheduler", started.address) == kept("here")


@pytest.mark.slow
def test_a_worker_of_other_software_or_without_the_folder_ends_the_run_in_one_line(tmp_path, monkeypatch):
    software_of, do, folder = scheduler.software_of, scheduler.Cluster.do, tmp_path / "run"

    def without_folder(self, *arguments):
        self.assets.unlink()
        return do(self, *arguments)

    with Dask(tmp_path, 1) as started:
        with monkeypatch.context() as patch:
            patch.setattr(
                scheduler, "software_of", lambda task: software_of(task) | {"package numpy": "1.0"}
            )
            other = r"^worker tcp:.*\(package numpy\); install the same there as here"
            with pytest.raises(RunStopped, match=other):
                together(folder, [task("one")], address=started.address)
        monkeypatch.setattr(scheduler.Cluster, "do", without_folder)
        with pytest.raises(RunStopped, match=r"worker tcp:.*does not see the run's folder .*--out"):
            together(folder, [task("one")], address=started.address)
    assert list(folder.iterdir()) == []


def test_where_nobody_answers_and_without_dask_the_remedy_is_said(monkeypatch):
    monkeypatch.setattr(scheduler, "FIRST", 0.3)
    with pytest.raises(RunRefused, match=r"no scheduler of dask .*; start one by"):
        scheduler.check_scheduler("tcp://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RunRefused, match="pip install"):
        scheduler.check_scheduler("tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_task_that_three_workers_died_of_has_failed_and_the_others_go_on(tmp_path):
    with Dask(tmp_path, 0) as started:
        started.add("--nanny")  # which starts a worker again
        batch = [task("deadly", "die with the worker", batch="b"), task("after", batch="b")]
        outcomes = together(tmp_path / "run", batch, [task("bad", "raise")], address=started.address)
    assert outcomes["deadly"].failed and "workers died while they did it" in outcomes["deadly"].reason
    assert outcomes["after"].status == "ok" and outcomes["bad"].reason == "ValueError: broken on purpose"


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 2])
def test_killed_at_random_moments_the_files_are_the_same(tmp_path, workers):
    """The runner, a worker, the scheduler; here a task's process. What was finished is not done again."""
    finish(tmp_path / "undisturbed", *chain())
    expected, folder = files(tmp_path / "undisturbed"), tmp_path / "run"
    chance, kills, begun = random.Random(7), 0, tmp_path / "begun"
    begun.touch()
    with Dask(tmp_path, workers) if workers else nullcontext() as cluster:
        options = {"address": cluster.address if cluster else "", "workers": 2, "retry": True}
        while kills < KILLS:
            runner = get_context("spawn").Process(
                target=finish, args=(folder, *chain(sleep=0.3)), kwargs=options
            )
            runner.start()
            while kills < KILLS and runner.is_alive():
                before = begun.read_text()
                until(lambda: begun.read_text() != before or not runner.is_alive())  # noqa: B023
                time.sleep(chance.uniform(0.0, 0.6))
                if not runner.is_alive():
                    break
                contents = {path: path.read_bytes() for path in folder.glob("cache/**/*.json")}
                kill_one(chance, cluster, runner, int(begun.read_text().split()[-1]))
                kills += 1
                assert {path: path.read_bytes() for path in contents} == contents
            runner.join(120)
            if files(folder) == expected:  # begin again: there are kills left
                for path in folder.rglob("*.json"):
                    path.unlink()
        finish(folder, *chain(), **options)
    assert len(expected) == 12 and files(folder) == expected
    until(lambda: not any(alive(int(pid)) for pid in begun.read_text().split()[1::2]), 15.0)


def kill_one(chance: random.Random, cluster: Dask | None, runner: SpawnProcess, pid: int) -> None:
    victim = chance.choice(("runner", "worker", "worker", "scheduler"))
    if victim == "runner":
        runner.kill()
        runner.join()
    elif cluster is None:
        with suppress(ProcessLookupError):  # it has just ended with the chain
            os.kill(pid, signal.SIGKILL)
    elif victim == "worker":
        worker = cluster.workers.pop(chance.randrange(len(cluster.workers)))
        worker.kill()
        worker.wait()
        cluster.add()
    else:
        cluster.restart_scheduler()
        cluster.add()
        cluster.add()
