"""A full disk loses nothing that was finished: one line, status 1, and the same command goes on with room.

A limit on the size of files stands for the full disk: both are found when a file grows.
"""

from __future__ import annotations

import errno
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import torch

from benchmarks import run
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.isolated_process import start_loading
from reference_sim.files.atomic_files import disk_full
from snug.networks.tensor_file import write_tensors
from tests.benchmarks.runner.tasks_by_hand import InProcess
from tests.reference_sim.test_trajectory import wave


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """No file of this process grows beyond that size [bytes].

    The server of worker processes, which would keep the limit, is started before.
    """
    start_loading()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize(
    "write",
    [
        lambda path: write_tensors(path, {"a": torch.ones(10_000)}, {"format": "x"}),
        lambda path: wave(400).save(path),
    ],
)
def test_a_file_that_finds_no_room_leaves_the_one_before_it(tmp_path, write):
    path = tmp_path / "a.npz"
    path.write_text("before")
    with pytest.raises(OSError, match="File too large") as full, files_up_to(4000):
        write(path)
    assert path.read_text() == "before" and os.listdir(tmp_path) == ["a.npz"]
    line = disk_full(full.value)
    assert line.startswith(f"{path}: File too large (") and "MB are free" in line
    assert disk_full(PermissionError(errno.EACCES, "no")) == disk_full(ValueError()) == ""


def test_a_run_stops_in_one_line_and_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    arguments = ["smoke:speed", "--scenes", "free_fall", "--methods", "simulation", "-o"]
    folder, other = RunFolder(tmp_path / "a"), RunFolder(tmp_path / "b")
    # Kernels that it compiles are files that grow, too.
    assert run.main([*arguments, str(other.path)]) == 0
    (trajectory,) = other.path.rglob("simulation.vtkhdf")
    limit = trajectory.stat().st_size - 1000
    monkeypatch.setattr(execution, "Executor", lambda folder, assets, *_: InProcess(folder, assets))
    with files_up_to(limit):
        status = run.main([*arguments, str(folder.path)])
    errors = capsys.readouterr().err
    (line,) = (line for line in errors.splitlines() if line.startswith("benchmarks.run: "))
    assert (
        status == 1 and "Traceback" not in errors and line.endswith("the same command goes on from there")
    )
    assert "simulation.vtkhdf: File too large" in line
    assert folder.read_config()["finished"] is None and not list(folder.path.rglob("*.part*"))
    assert run.main([*arguments, str(folder.path)]) == 0
    rows, expected = (
        [(r.metric, r.value, r.status) for r in place.read_rows() if "cost/" not in r.metric]
        for place in (folder, other)
    )
    assert rows == expected
