"""One thread and no garbage for all tests. What a refusal by a command is; narrow networks."""

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.timing import one_thread

one_thread()  # before any library reads it: the processes of the tests would fight over the cores


def pytest_collection_finish() -> None:
    """Leave modules and tests out of all collections: each timed run of a method begins with one."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def refused(capsys, tmp_path) -> Callable[..., str]:
    """A check that a command refuses: one line of error, status 2, and `tmp_path` as it was.

    `refused(hint, main, *arguments)` calls main(*arguments), wants `hint` in the line, and returns the
    line.
    """

    def check(hint: str, main: Callable[..., int], *arguments: Any) -> str:
        before = _files(tmp_path)
        capsys.readouterr()
        try:
            status = main(*arguments)
        except SystemExit as end:  # the parser's own refusal
            status = end.code
        out, error = capsys.readouterr()
        assert status == 2 and out == "" and error.count("\n") == 1 and hint in error, error
        assert _files(tmp_path) == before
        return error

    return check


@pytest.fixture
def narrow(monkeypatch) -> None:
    """Hidden layers of 60 in place of the papers' 1500 and 1024, where their size is not the subject."""
    monkeypatch.setattr("snug.networks.santesteban2019.WRINKLE_WIDTH", 60)  # fills no vector, as 1500
    monkeypatch.setattr("snug.networks.tailornet.WIDTH", 60)


def _files(folder: Path) -> dict[Path, int]:
    """Return each path in a folder, with the time of a file's last change; caches of Python do not count."""
    paths = [path for path in folder.rglob("*") if "__pycache__" not in path.parts]
    return {path: path.stat().st_mtime_ns if path.is_file() else 0 for path in paths}
