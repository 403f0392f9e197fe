"""Isolated processes: hangs and crashes are ended, and the next work is done."""

from __future__ import annotations

import operator
import os
import sys
import time
from contextlib import closing

import pytest

from benchmarks.isolated_process import LOADED_BY_ALL, IsolatedProcess, WorkerDied


def test_a_hang_and_a_crash_are_ended_and_the_next_work_is_done():
    with closing(IsolatedProcess()) as process:
        assert process.call(operator.mul, 2, 4, seconds=60) == 8
        began = time.monotonic()
        with pytest.raises(WorkerDied, match=r"no answer within 0\.2 s"):
            process.call(time.sleep, 1000, seconds=0.2)
        assert time.monotonic() - began < 4.0
        with pytest.raises(WorkerDied, match="ended with status 7"):
            process.call(os._exit, 7, seconds=60)
        with pytest.raises(ValueError, match="invalid literal"):
            process.call(int, "x", seconds=60)
        assert process.call(operator.mul, 2, 5, seconds=60) == 10


def interrupt():
    raise KeyboardInterrupt("by the work itself")


def test_an_interrupt_that_the_work_raises_is_a_failure_of_the_work():
    with closing(IsolatedProcess()) as process:
        with pytest.raises(WorkerDied, match="KeyboardInterrupt: by the work itself"):
            process.call(interrupt, seconds=60)
        assert process.call(operator.mul, 2, 4, seconds=60) == 8


def test_a_process_that_cannot_start_is_none_at_all():
    with closing(IsolatedProcess(lambda: None)) as process:  # cannot be sent to it
        for _ in range(2):
            with pytest.raises(Exception, match="lambda"):
                process.call(operator.mul, 2, 4, seconds=1)


def loaded(names):
    return [name for name in names if name in sys.modules]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere each process loads its own")
def test_a_process_begins_with_what_all_need_and_nothing_that_a_scene_may_do_without():
    assert "torch" not in LOADED_BY_ALL
    with closing(IsolatedProcess()) as process:
        names = [*LOADED_BY_ALL, "torch", "igl", "snug", "reports"]
        assert process.call(loaded, names, seconds=60) == list(LOADED_BY_ALL)
