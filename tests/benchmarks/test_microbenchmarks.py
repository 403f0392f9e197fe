"""Microbenchmarks: each does at a small size what it times."""

from __future__ import annotations

import re

import numpy as np
import pytest

from benchmarks.performance import microbenchmarks

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
