"""Garbage: what is loaded when the tests begin is none. And what a refusal by a command is."""

import gc
from collections.abc import Callable
from typing import Any

import pytest


def pytest_collection_finish() -> None:
    """Leave modules and tests out of all collections: each timed run of a method begins with one."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def refused(capsys, tmp_path) -> Callable[..., str]:
    """A check that a command refuses: one line of error, status 2, and `tmp_path` as it was.

    `refused(hint, main, *arguments)` calls main(*arguments), wants `hint` in the line, and returns the line.
    """

    def check(hint: str, main: Callable[..., int], *arguments: Any) -> str:
        before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
        capsys.readouterr()
        try:
            status = main(*arguments)
        except SystemExit as end:  # the parser's own refusal
            status = end.code
        out, error = capsys.readouterr()
        assert status == 2 and out == "" and error.count("\n") == 1 and hint in error, error
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
        return error

    return check
