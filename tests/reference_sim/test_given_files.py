"""Files of anyone: pipes and devices are read by no reader, TOML has a size and a depth."""

from __future__ import annotations

import os

import pytest

from benchmarks.results.row import read_json
from benchmarks.results.run_folder import RunFolder
from reference_sim import Material, Trajectory
from reference_sim.files.array_file import read_arrays, read_pickled_arrays
from reference_sim.given_files import DEEPEST, parse_toml
from snug.motion.recording import parse_lines

READERS = {
    "arrays": read_arrays,
    "pickle": lambda path: read_pickled_arrays(path, ()),
    "material": Material.from_file,
    "motion": lambda path: parse_lines(path, list),
    "JSON": read_json,
    "rows": lambda path: RunFolder(path.parent).read_rows(),
    "trajectory": Trajectory.load,
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/null")])
def test_a_pipe_and_a_device_are_refused(tmp_path, name, make):
    path = tmp_path / "results.csv"
    make(path)
    with pytest.raises((OSError, ValueError), match=r"results\.csv.* is no regular file"):
        READERS[name](path)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (".".join("a" * 30000) + " = 1", "a name of more than 32 parts"),
        ("[" + " . ".join(['"a.b"'] * 99) + "]", "a name of more than 32 parts"),
        ("x = {'\"' = 1, " + ".".join("a" * 99) + " = '\"'}", "a name of more than 32 parts"),
        ("x = " + "[" * 40 + "]" * 40, "more than 32 deep"),
        ("x = " + "[" * 9000 + "]" * 9000, "more than 32 deep"),
        ("x = " + "9" * 309, "a whole number beyond 64 bits"),
        ("x = [{y = -9223372036854775809}]", "a whole number beyond 64 bits"),
    ],
)
def test_toml_that_nobody_writes_is_refused_at_once(text, fault):
    with pytest.raises(ValueError, match=fault):
        parse_toml(text)


def test_toml_that_people_write_is_read():
    long = ".".join("a" * (DEEPEST - 1)) + " = 1"
    text = f"{long}\nb = '{'../a.' * 99}'\nc = [{'1.5, ' * 99}]\nd = -9223372036854775808"
    assert list(parse_toml(text)) == ["a", "b", "c", "d"]
