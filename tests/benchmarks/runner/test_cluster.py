"""A cluster gives what this machine gives, whatever of it dies; and what cannot work is said in one line."""

from __future__ import annotations

import os
import signal
import socketserver
import sys
import threading

import numpy as np
import pytest

pytest.importorskip("distributed")

from benchmarks import run
from benchmarks.plan.make_plan import check_scheduler_fits
from benchmarks.plan.plan import PlanError
from benchmarks.plan.request import Request
from benchmarks.process import cluster_address as scheduler
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import cluster_executor as runner_side
from benchmarks.runner import cluster_worker
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.cluster_executor import ClusterExecutor
from benchmarks.runner.local_executor import LocalExecutor
from benchmarks.tasks.task import RunStopped
from snug.networks.tensor_file import read_tensors
from tests.benchmarks.runner.cluster_by_hand import (
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
from tests.benchmarks.runner.tasks_by_hand import Bar


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A scheduler and two workers, for all tests that kill neither."""
    with cluster(tmp_path_factory.mktemp("cluster"), 2) as started:
        yield started


# --- what comes back ---------------------------------------------------------------------------------------


def test_a_cluster_leaves_the_same_files_as_processes_here(two, folder, tmp_path):
    here = tmp_path / "here"
    here.mkdir()
    finish(here, LocalExecutor(RunFolder(here), None, 2))
    runner = finish(folder.path, ClusterExecutor(folder, None, 1, two.address))
    assert len(files(here)) == 12 and files(folder.path) == files(here)
    origins = [outcome.origin for outcome in runner.outcomes.values()]
    assert {o["commit"] for o in origins} == {"c"} and "h" not in {o["hardware"] for o in origins}
    again = ClusterExecutor(folder, None, 1, two.address)
    assert again.side_by_side == 2  # of which the time left is made; both have come by now
    assert len(finish(folder.path, again).reused) == 12


def test_failures_are_values_and_a_batch_stays_together(two, folder):
    large = 2_000_005  # numbers
    batch = [write("one"), write("bad", how="raise"), write("large", count=large)]
    others = [[write(name)] for name in "abc"]  # two of these in one process
    # Nothing beside the batch: a worker that is given another task between two of the batch forgets it.
    outcomes = together(folder, two.address, batch)
    outcomes |= together(folder, two.address, *others)
    outcomes |= together(folder, two.address, [write("dies", how="die")])
    assert outcomes["large"].result["memo"] == ["one", "large"]
    assert all(outcomes[name].result["memo"] == [name] for name in "abc")
    assert outcomes["bad"].reason == "ValueError: broken on purpose"
    assert outcomes["dies"].status == "out-of-memory" and "SIGKILL" in outcomes["dies"].reason
    expected = np.random.default_rng(0).random(large)
    np.testing.assert_array_equal(np.load(folder.path / "numbers" / "large.npy"), expected)
    task = write("from large", needs=(("numbers", "large"),), count=large)
    together(folder, two.address, [task], needed={("numbers", "large"): outcomes["large"]})
    np.testing.assert_array_equal(np.load(folder.path / "numbers" / "from large.npy"), 2.0 * expected)


def test_a_worker_has_its_next_task_before_results_of_others_are_taken(two, folder, monkeypatch):
    monkeypatch.setattr(runner_side, "POLL", 1.0)  # both have ended then
    calls = []
    for name in ("_take", "_submit"):
        method = getattr(ClusterExecutor, name)
        monkeypatch.setattr(
            ClusterExecutor, name,
            lambda self, *args, method=method, name=name: (calls.append(name), method(self, *args))[1],
        )  # fmt: skip
    together(folder, two.address, *([write(name)] for name in "abcd"))
    assert calls == ["_submit", "_submit", *["_take", "_submit"] * 2, *["_take"] * 2]


def test_progress_is_told_while_tasks_run(two, folder, monkeypatch):
    monkeypatch.setattr(runner_side, "LOOK", 0.1)
    updates = []
    monkeypatch.setattr(Bar, "update", lambda self, units=1: updates.append(units))
    together(folder, two.address, [write("one", units=7), write("two", units=5, seconds=1.0)])
    assert 7 in updates


@pytest.mark.slow
def test_a_run_on_a_cluster_is_that_of_this_machine(tmp_path, monkeypatch):
    """Bit for bit, but for times: a network that learned from ground truth, and metrics of all frames."""
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    options = ["--preset", "smoke", "--suite", "garments", "--split", "validation"]
    options += ["--scenes", "tshirt/sudden_stop", "--methods", "simulation,supervised"]
    here, cluster_folder = RunFolder(tmp_path / "here"), RunFolder(tmp_path / "there")
    assert run.main([*options, "-o", str(here.path)]) == 0
    with cluster(tmp_path, 2) as started:
        assert run.main([*options, "-o", str(cluster_folder.path), "--scheduler", started.address]) == 0
    assert kept(here) == kept(cluster_folder)


def kept(folder: RunFolder) -> tuple[dict, dict]:
    """All numbers but costs, and the weights of the network."""
    rows = [row for row in folder.read_rows() if not row.metric.startswith("cost/")]
    weights = read_tensors(folder.models / "supervised-seed0.safetensors")[0]
    return (
        {(row.scene, row.method, row.metric): (row.value, row.uncertainty, row.status) for row in rows},
        {name: tensor.numpy().tobytes() for name, tensor in weights.items()},
    )


# --- what is refused ---------------------------------------------------------------------------------------


def test_a_worker_with_other_software_is_left_out_in_one_line(two, folder, monkeypatch, capsys):
    software_of = cluster_worker.software_of
    other = {"package numpy": "numpy 1.0", "benchmarks/runner/local_executor.py": "0"}
    monkeypatch.setattr(cluster_worker, "software_of", lambda task: software_of(task) | other)
    with pytest.raises(RunStopped, match="can be used") as stopped:
        together(folder, two.address, [write("one")])
    assert "package numpy: numpy 2" in str(stopped.value) and "numpy 1.0 here" in str(stopped.value)
    assert "benchmarks/runner/local_executor.py" in str(stopped.value) and list(folder.path.iterdir()) == []
    notices = [
        line for line in capsys.readouterr().err.splitlines() if line.startswith("left out: worker tcp:")
    ]
    assert len(notices) == 2


def test_a_worker_that_does_not_see_the_folder_is_left_out_in_one_line(
    two, folder, tmp_path, monkeypatch, capsys
):
    opener = ClusterExecutor._open

    def elsewhere(self):
        opener(self)
        self._path = str(tmp_path / "elsewhere")

    monkeypatch.setattr(ClusterExecutor, "_open", elsewhere)
    with pytest.raises(RunStopped, match=r"does not see the folder .*elsewhere.*--out"):
        together(folder, two.address, [write("one")])
    notices = [
        line for line in capsys.readouterr().err.splitlines() if line.startswith("left out: worker tcp:")
    ]
    assert len(notices) == 2 and list(folder.path.iterdir()) == []


def test_what_comes_damaged_is_not_kept(two, folder, monkeypatch):
    take = ClusterExecutor._take

    def damaged(self, future):
        (folder.path / "numbers" / "one.npy").write_bytes(b"damaged")
        return take(self, future)

    monkeypatch.setattr(ClusterExecutor, "_take", damaged)
    with pytest.raises(RunStopped, match=r"one\.npy is damaged, seen from here"):
        together(folder, two.address, [write("one")])


def test_what_was_damaged_here_is_not_built_upon(two, folder):
    (first,) = together(folder, two.address, [write("first")]).values()
    (folder.path / first.files[0]).write_bytes(b"damaged")
    with pytest.raises(RunStopped, match=r"first\.npy is damaged since this run wrote it"):
        together(folder, two.address, [write("second")], needed={("numbers", "first"): first})


def test_a_scheduler_that_does_not_answer_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(scheduler, "FIRST", 0.3)
    options = ["--scenes", "free_fall", "-o", str(tmp_path / "run"), "--scheduler"]
    assert run.main([*options, "tcp://127.0.0.1:1"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "--scheduler tcp://127.0.0.1:1" in error and "dask scheduler" in error
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert run.main([*options, "tcp://127.0.0.1:1"]) == 2
    assert "pip install" in capsys.readouterr().err and not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        (b"HTTP/1.0 400 Bad Request\r\n\r\n", "what answers there is no scheduler"),
        (b"", "no answer of a scheduler within 1 s"),
    ],
)
def test_another_server_than_a_scheduler_is_refused_in_one_line(
    answer, problem, tmp_path, monkeypatch, capsys
):
    """A web server, and one that waits for its caller to speak on."""
    monkeypatch.setattr(scheduler, "FIRST", 1.0)
    callers = []

    class Answer(socketserver.BaseRequestHandler):
        def handle(self):
            callers.append(self.request)
            self.request.sendall(answer)
            asked.wait(5.0)

    asked = threading.Event()
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Answer) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.server_address[1]}"
        options = ["--scenes", "free_fall", "-o", str(tmp_path / "run"), "--scheduler", address]
        assert run.main(options) == 2 and callers
        asked.set()
        server.shutdown()
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and f"--scheduler {address}: {problem}; start a scheduler by" in error


def test_a_worker_is_no_scheduler(two):
    with scheduler.connect(two.address, seconds=5.0) as client:
        client.wait_for_workers(1, timeout=30.0)
        worker = next(iter(client.nthreads()))
    with pytest.raises(scheduler.ClusterError, match="is a worker of dask; start a scheduler"):
        scheduler.check_scheduler(worker)


@pytest.mark.parametrize(("option", "value"), [("device", "cuda"), ("rollout", ["mine=out.npz"])])
def test_what_a_cluster_cannot_do_is_refused(option, value):
    name = {"rollout": "roll_outs"}.get(option, option)
    with pytest.raises(PlanError, match=f"--{option}.*leave out --scheduler"):
        check_scheduler_fits(Request(scheduler="tcp://127.0.0.1:1", **{name: value}))


# --- what dies ---------------------------------------------------------------------------------------------


def test_an_interrupt_ends_what_the_cluster_does_and_leaves_the_cluster(two, folder, tmp_path, request):
    mark = tmp_path / "mark"

    def interrupt():
        until(lambda: len(lines(mark)) == 2)
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        together(folder, two.address, *([write(f"{n}", seconds=60.0, mark=str(mark))] for n in range(4)))
    until(lambda: not any(alive(task) for _, task in lines(mark)), 10.0)
    assert len(lines(mark)) == 2 and not list(folder.path.rglob(".*"))
    assert together(folder, two.address, [write("after")])["after"].status == "ok"


def test_what_a_killed_runner_had_begun_is_ended(two, folder, tmp_path):
    mark = tmp_path / "mark"
    runner = start_runner(folder.path, two.address, seconds=60.0, mark=mark)
    until(lambda: len(lines(mark)) == 2)
    runner.kill()
    runner.wait()
    until(lambda: not any(alive(task) for _, task in lines(mark)), 10.0)
    assert together(folder, two.address, [write("after")])["after"].status == "ok"
