"""A cluster gives what this machine gives, whatever of it dies; and what cannot work is said in one line."""

from __future__ import annotations

import socketserver
import sys
import threading

import numpy as np
import pytest

from benchmarks import run
from benchmarks.plan.make_plan import check_machines
from benchmarks.plan.study import StudyError
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import cluster as runner_side
from benchmarks.runner import cluster as scheduler
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.task import RunRefused, RunStopped
from snug.networks.tensor_file import read_tensors
from tests.benchmarks.plan.planned import study_with
from tests.benchmarks.runner.cluster_by_hand import (
    cluster,
    files,
    finish,
    together,
    write,
)

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A scheduler and two workers, for all tests that kill neither."""
    with cluster(tmp_path_factory.mktemp("cluster"), 2) as started:
        yield started


# --- what comes back ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_cluster_leaves_the_same_files_as_processes_here(two, folder, tmp_path):
    here = tmp_path / "here"
    here.mkdir()
    finish(here)
    runner = finish(folder.path, two.address)
    assert len(files(here)) == 12 and files(folder.path) == files(here)
    origins = [outcome.origin for outcome in runner.outcomes.values()]
    assert {o["commit"] for o in origins} == {"c"} and "h" not in {o["hardware"] for o in origins}
    assert len(finish(folder.path, two.address).reused) == 12


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_run_on_a_cluster_is_that_of_this_machine(tmp_path, monkeypatch):
    """Bit for bit, but for times: a network that learned from ground truth, and metrics of all frames."""
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    options = ["smoke:garments", "--set", "split=validation"]
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


@pytest.mark.slow
def test_a_worker_of_other_software_or_without_the_folder_ends_the_run_in_one_line(two, folder, monkeypatch):
    software_of = runner_side.software_of
    other = {"package numpy": "numpy 1.0", "benchmarks/runner/executor.py": "0"}
    with monkeypatch.context() as patch:
        patch.setattr(runner_side, "software_of", lambda task: software_of(task) | other)
        with pytest.raises(RunStopped, match="install the same there as here") as stopped:
            together(folder, two.address, [write("one")])
    assert str(stopped.value).startswith("worker tcp:") and "benchmarks/runner/executor.py" in str(
        stopped.value
    )
    assert "package numpy: numpy 2" in str(stopped.value) and "numpy 1.0 here" in str(stopped.value)
    do = runner_side.Cluster.do

    def without_folder(self, *arguments):
        self.assets.unlink()
        return do(self, *arguments)

    monkeypatch.setattr(runner_side.Cluster, "do", without_folder)
    with pytest.raises(RunStopped, match=r"worker tcp:.*does not see the folder .*--out"):
        together(folder, two.address, [write("one")])
    assert list(folder.path.iterdir()) == []


@pytest.mark.slow
def test_what_comes_damaged_is_not_kept(two, folder, monkeypatch):
    take = distributed.Future.result

    def damaged(self):
        answer = take(self)
        (folder.path / "numbers" / "one.npy").write_bytes(b"damaged")
        return answer

    monkeypatch.setattr(distributed.Future, "result", damaged)
    with pytest.raises(RunStopped, match=r"one\.npy is damaged, seen from here"):
        together(folder, two.address, [write("one")])


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        (b"HTTP/1.0 400 Bad Request\r\n\r\n", "MemoryError"),  # a web server
        (b"", "TimeoutError"),  # one that waits for its caller to speak on
    ],
)
def test_another_server_than_a_scheduler_is_refused_in_one_line(
    answer, problem, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(scheduler, "FIRST", 1.0)
    asked = threading.Event()

    class Answer(socketserver.BaseRequestHandler):
        def handle(self):
            self.request.sendall(answer)
            asked.wait(5.0)

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Answer) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.server_address[1]}"
        options = ["--scenes", "free_fall", "-o", str(tmp_path / "run"), "--scheduler", address]
        assert run.main(options) == 2
        asked.set()
        server.shutdown()
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "start one by `dask scheduler`" in error
    assert f"--scheduler {address}: no scheduler of dask answers there ({problem}" in error
    assert not (tmp_path / "run").exists()


def test_where_nobody_answers_and_without_dask_the_remedy_is_said(monkeypatch):
    monkeypatch.setattr(scheduler, "FIRST", 0.3)
    with pytest.raises(RunRefused, match=r"no scheduler of dask .*; start one by"):
        scheduler.check_scheduler("tcp://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RunRefused, match="pip install"):
        scheduler.check_scheduler("tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_worker_is_no_scheduler(two):
    with distributed.Client(two.address) as client:
        client.wait_for_workers(1, timeout=30.0)
        worker = next(iter(client.nthreads()))
    with pytest.raises(RunRefused, match=r"\(Worker\); start one"):
        scheduler.check_scheduler(worker)


@pytest.mark.parametrize(("field", "value"), [("device", "cuda"), ("rollouts", {"mine": {"path": "a.npz"}})])
def test_what_a_cluster_cannot_do_is_refused(field, value, tmp_path, monkeypatch):
    monkeypatch.setattr("snug.training.device.find_device", lambda name: None)
    with pytest.raises(StudyError, match=f"--{field}.*leave out --scheduler"):
        check_machines(study_with(**{field: value}), tmp_path, "tcp://127.0.0.1:1")
