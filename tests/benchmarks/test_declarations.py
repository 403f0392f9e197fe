"""Declarations that cannot be meant are refused, each by one line that names them."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.methods import METHODS
from benchmarks.metric import Metric
from tests.benchmarks.runner.tasks_by_hand import small_scene

METRIC = Metric(name="mine/x", unit="J", title="Mine", definition="mine")
BUILT = small_scene("hanging_sheet")


@pytest.mark.parametrize(
    ("declared", "wrong", "message"),
    [
        (METRIC, {"unit": ""}, "metric 'mine/x' has no unit: say '1' where it has no dimension"),
        (METHODS[0], {"role": "solvr"}, "unknown role 'solvr'; use one of reference, "),
        (BUILT, {"dt": 33.3}, "dt 33.3: give the duration of a frame in seconds, above 0 and at most 1"),
        (BUILT, {"warm_up": 1}, "warm_up 1: give 2 frames or more"),
        (BUILT, {"energies": 2 * BUILT.energies}, "energy 'strain' is declared twice"),
    ],
)
def test_what_cannot_be_meant_is_named(declared, wrong, message):
    with pytest.raises(ValueError) as refused:
        dataclasses.replace(declared, **wrong)
    assert message in str(refused.value)
