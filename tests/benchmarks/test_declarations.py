"""Declarations that cannot be meant are refused, each by one line that names them."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.declarations import DeclarationError
from benchmarks.methods import METHODS
from benchmarks.metric import Metric
from benchmarks.presets import find_preset
from benchmarks.scenes import SCENES
from tests.benchmarks.runner.tasks_by_hand import small_scene

METRIC = Metric(name="mine/x", unit="J", title="Mine", definition="mine")
BUILT = small_scene("hanging_sheet")


@pytest.mark.parametrize(
    ("declared", "wrong", "message"),
    [
        (METRIC, {"unit": ""}, "metric 'mine/x' has no unit: say '1' where it has no dimension"),
        (METRIC, {"of": "clock"}, "metric 'mine/x': of='clock'"),
        (METHODS[0], {"role": "solvr"}, "unknown role 'solvr'; use one of reference, "),
        (BUILT, {"dt": 33.3}, "dt 33.3: give the duration of a frame in seconds, above 0 and at most 1"),
        (BUILT, {"dt": 0.0}, "scene hanging_sheet: dt 0: give the duration"),
        (BUILT, {"warm_up": 1}, "warm_up 1: give 2 frames or more"),
        (BUILT, {"energies": 2 * BUILT.energies}, "energy 'strain' is declared twice"),
    ],
)
def test_what_cannot_be_meant_is_named(declared, wrong, message):
    with pytest.raises(ValueError) as refused:
        dataclasses.replace(declared, **wrong)
    assert message in str(refused.value)


def test_a_size_that_no_preset_has_is_named():
    scene = dataclasses.replace(SCENES[0], sizes=("sheet_cell",))
    with pytest.raises(DeclarationError, match="'sheet_cell', which no preset has"):
        scene.at(find_preset("smoke"))
