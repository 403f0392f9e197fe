"""Cases in a process of their own: what hangs or dies there is a failed row, and the next case is run."""

from __future__ import annotations

import os
import signal
import time

import pytest

from benchmarks.validation.case import Case
from benchmarks.validation.isolated import run_isolated, shared_process

warm = 0.0  # in the worker: how often it was warmed up


def warm_up():
    global warm
    warm += 1.0


def warmth():
    return warm


def hang():
    time.sleep(1000)


def crash():
    signal.signal(signal.SIGSEGV, signal.SIG_DFL)
    os.kill(os.getpid(), signal.SIGSEGV)


def killed():
    os.kill(os.getpid(), signal.SIGKILL)


def wrong():
    raise RuntimeError("lost")


def case(function: str, seconds: float = 60.0) -> Case:
    return Case(
        name="planted", suite="extremes", description="", module=__name__, function=function, seconds=seconds,
        metric="outcome", expected=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("function", "seconds", "words", "times_warm"),
    [
        ("hang", 0.5, "no answer within 0.5 s", 1),
        ("crash", 60.0, "ended by SIGSEGV", 1),
        ("killed", 60.0, "out of memory", 1),
        ("wrong", 60.0, "RuntimeError: lost", 2),  # the process lives on
        ("absent", 60.0, "AttributeError", 2),
    ],
)
def test_what_did_not_come_back_is_a_failed_row_and_the_next_case_is_run(
    function, seconds, words, times_warm
):
    try:
        row = run_isolated(case(function, seconds))
        assert (row.status, row.value, row.expected) == ("failed", None, 0.0) and words in row.reason
        assert (row.suite, row.scene, row.metric) == ("extremes", "planted", "outcome")
        assert run_isolated(case("warmth")).value == times_warm
    finally:
        shared_process().close()


def test_a_warm_up_that_fails_fails_the_case(monkeypatch):
    monkeypatch.setattr("benchmarks.validation.isolated.WARM_UP_SECONDS", 0.0)
    try:
        assert "no answer within 0 s" in run_isolated(case("warmth")).reason
    finally:
        shared_process().close()
