"""Microbenchmarks: each does at a small size what it times."""

from __future__ import annotations

import pytest

from benchmarks.performance import microbenchmarks


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("SolverStep", (4, "newton")), ("ContactSearch", (300,)), ("TrainingStep", ("supervised", 300)),
        ("NetworkFrame", ("pbns", 300)),
    ],
)  # fmt: skip
def test_each_class_does_again_what_it_has_set_up(name, values):
    benchmark = getattr(microbenchmarks, name)()
    benchmark.setup(*values)
    (timed,) = (getattr(benchmark, name) for name in dir(benchmark) if name.startswith("time_"))
    made = set(vars(benchmark))
    timed(*values)
    timed(*values)
    assert set(vars(benchmark)) == made  # nothing is set up on the clock
