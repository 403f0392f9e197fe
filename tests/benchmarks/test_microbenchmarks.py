"""Microbenchmarks: each does at a small size what it times, and the solver's step is the simulator's."""

from __future__ import annotations

import re

import numpy as np
import pytest

from benchmarks.performance import microbenchmarks
from benchmarks.performance.microbenchmarks import DT, SolverStep
from reference_sim import simulate
from reference_sim.energies import BendHinge, Gravity, StretchStVK

SMALL = {
    "SolverStep": ((4,), ("newton", "lbfgs")),
    "ContactSearch": ((300,),),
    "TrainingStep": (("supervised",), (300,)),
    "NetworkFrame": (("pbns",), (300,)),
}


@pytest.mark.parametrize("name", SMALL)
def test_a_plain_call_times_each_class(name, monkeypatch, capsys):
    kind = getattr(microbenchmarks, name)
    assert kind in microbenchmarks.CLASSES and len(microbenchmarks.CLASSES) == len(SMALL)
    monkeypatch.setattr(kind, "params", SMALL[name])
    microbenchmarks.print_times([kind], repeats=2)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == np.prod([len(values) for values in SMALL[name]])
    assert all(float(re.fullmatch(rf"{name}\.time_\w+\(.*\): ([\d.]+) ms", line)[1]) > 0 for line in lines)


def test_the_step_of_the_sheet_is_that_of_a_simulation():
    benchmark = SolverStep()
    benchmark.setup(6, "newton")
    cloth, start = benchmark.stepper.cloth, benchmark.start
    _, (result,) = benchmark.stepper.advance(1, start, None)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    simulated = simulate(cloth, terms, dt=DT, frames=2, start=start.x, method="newton")
    assert result.iterations == simulated.frame_fields["iterations"][1] > 1
    assert np.array_equal(result.positions, simulated.positions[1])
