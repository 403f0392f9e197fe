"""The clock counts the work and nothing else, and finds out who comes back before the work is done."""

from __future__ import annotations

import multiprocessing
import os
import resource
import threading
import time
from pathlib import Path

import numba
import numpy as np
import pytest

from benchmarks.timing import MOST, Reading, peak_memory, time_run


def positions_of(made):
    return made


def work(seconds: float) -> None:
    # By the clock that measures, and the processor's too: one that is ahead of the other ends the work
    # early.
    begin, used = time.perf_counter(), time.process_time()
    while min(time.perf_counter() - begin, time.process_time() - used) < seconds:
        pass


def test_what_is_made_only_when_it_is_looked_at_is_made_on_the_clock():
    class Lazy:
        def __array__(self, dtype=None, copy=None):
            work(0.1)
            return np.zeros((2, 3, 3))

    assert time_run(Lazy, read=positions_of)[1].seconds >= 0.1


def test_short_work_is_done_again_until_enough_is_measured_and_long_work_once():
    def run():
        work(0.01)
        return np.zeros((2, 3, 3))

    # A busy machine takes the processor away for some 0.1 s: far less than what is asked for.
    _, reading = time_run(run, read=positions_of, min_time=0.4)
    assert len(reading.runs) > 1 and reading.complaint == ""
    assert sum(reading.runs[:-1]) < 0.4 <= sum(reading.runs)
    assert Reading((3.0, 1.0, 9.0, 2.0)).seconds == 2.5
    assert len(time_run(run, read=positions_of)[1].runs) == 1
    _, reading = time_run(lambda: np.zeros(1), read=positions_of, min_time=60.0)
    assert len(reading.runs) == MOST


def test_most_memory_is_between_what_is_held_and_the_systems_count():
    memory = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1.024e-3
    assert 0.9 * memory <= peak_memory() <= 1.02 * most


@pytest.mark.parametrize("always", [False, True])
def test_a_first_run_that_compiles_is_no_measurement(always):
    kernels, calls, lasted = [], [], []

    def run():
        begin = time.perf_counter()
        if always or not kernels:
            kernels.append(numba.njit(lambda x: x + 1.0))
        time.sleep(0.0 if calls else 0.2)  # the first lasts longer, by far
        calls.append(kernels[-1](1.0))
        lasted.append(time.perf_counter() - begin)
        return np.zeros((2, 3, 3))

    _, reading = time_run(run, read=positions_of)
    assert len(calls) == 2 and len(reading.runs) == 1  # whoever compiles in each run is measured so
    assert abs(reading.seconds - lasted[1]) < abs(reading.seconds - lasted[0]) and reading.complaint == ""


def test_an_answer_that_was_kept_from_the_first_run_is_found():
    x = np.zeros((2, 3, 3))
    _, reading = time_run(lambda: x[:], read=positions_of, min_time=1.0)
    assert "what it had given before" in reading.complaint and len(reading.runs) == 2
    assert time_run(lambda: x, read=positions_of)[1].complaint == ""


@pytest.mark.parametrize("pause", [0.0, 0.01])
def test_a_thread_that_only_computes_or_only_waits_is_found_too(pause):
    stop = threading.Event()

    def go_on():
        while not stop.is_set():
            if pause:
                stop.wait(pause)

    def run():
        threading.Thread(target=go_on, name="behind", daemon=True).start()
        return np.zeros((2, 3, 3))

    _, reading = time_run(run, read=positions_of)
    stop.set()
    assert "at work" in reading.complaint or "behind was still running" in reading.complaint


def test_a_process_that_goes_on_is_found():
    process = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(30,), name="outside")

    def run():
        process.start()
        return np.zeros((2, 3, 3))

    _, reading = time_run(run, read=positions_of)
    process.kill()
    process.join()
    assert "outside was still running" in reading.complaint


def test_more_than_one_thread_at_work_is_found(monkeypatch):
    # Two threads use processor time twice as fast as time goes by, on a machine with a core for each.
    monkeypatch.setattr("benchmarks.timing.time.process_time", lambda: 2.0 * time.perf_counter())

    def run():
        time.sleep(0.2)
        return np.zeros((2, 3, 3))

    _, reading = time_run(run, read=positions_of)
    assert "more than one thread" in reading.complaint
