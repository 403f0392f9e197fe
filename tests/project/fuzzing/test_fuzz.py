"""Files that nobody meant: every reader refuses them in one line, at once, without taking the memory."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from snug.motion.files import load_motions
from snug.motion.motion import MotionError
from tests.project.fuzzing.fuzz_readers import READERS, problem_of

HERE = Path(__file__).resolve().parent


@pytest.mark.parametrize("name", ["arrays", "AMASS", "body pickle", "BVH", "amc", "asf"])
def test_some_mutated_files_are_refused_in_one_line(name, tmp_path):
    (reader,) = (reader for reader in READERS if reader.name == name)
    path, refused = tmp_path / f"mutated{reader.suffix}", 0
    reader.write(path)
    data = path.read_bytes()
    for number in range(8):
        path.write_bytes(reader.mutate(data, random.Random(number)))
        problem, was_refused = problem_of(reader, path)
        refused += was_refused
        assert problem == ""
    assert refused > 2


@pytest.mark.slow
def test_mutated_files_are_refused_in_one_line(tmp_path):
    count = 2001
    done = subprocess.run(
        [sys.executable, HERE / "fuzz_readers.py", str(count), tmp_path],
        env=os.environ | {"PYTHONPATH": str(HERE.parents[2])}, capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    last = tmp_path / "last"
    at = last.read_text() if last.is_file() else "the valid files"
    assert done.returncode == 0, f"ended at {at}: {done.stderr[-2000:]}"
    summary = json.loads(done.stdout)
    assert summary["problems"] == []
    assert summary["refused"] > 0.7 * count and summary["peak"] < 2000.0 and summary["slowest"] < 10.0


@pytest.mark.parametrize("name", [b"a" * 246, b"walk\xff", b"two\nlines", b"=1+1"])
def test_a_motion_that_no_file_can_be_named_after_is_refused(name, tmp_path):
    path = tmp_path / os.fsdecode(name + b".npz")
    path.write_bytes(b"")
    with pytest.raises(MotionError, match="a name of at most 100 bytes") as refused:
        load_motions(path)
    assert str(refused.value).isascii() and "\n" not in str(refused.value)
