"""The validation suite: every check passes, and its own machinery judges as it should."""

from __future__ import annotations

import collections
import dataclasses
import math

import pytest

from benchmarks.check import Check
from benchmarks.checks.slope import order
from benchmarks.plan import Motions, choose_cells
from benchmarks.presets import find_preset
from benchmarks.suites.validation import CHECKS, run_check


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_a_check_passes(check):
    row = run_check(check)
    assert row.status == "ok", row.reason


def test_there_are_enough_of_every_kind():
    names = [check.name for check in CHECKS]
    assert len(set(names)) == len(names)
    judged = [check for check in CHECKS if check.tolerance is not None]
    assert len(judged) >= 40
    assert sum(name.endswith("_order") for name in names) >= 9
    assert all(check.reason for check in CHECKS)
    # A number is judged against a number: declared, or solved by the check itself.
    modules = collections.Counter(check.module for check in judged if check.expected is None)
    assert set(modules) <= {"membrane", "few_masses", "statics", "clamped_stretch"}


def test_the_smallest_preset_runs_the_quick_ones_unless_a_check_is_named():
    def chosen(preset, scenes=()):
        nothing = Motions((), (), {})
        return choose_cells(
            ("validation",), full=True, preset=find_preset(preset), motions=nothing,
            scenes=scenes, methods=(), seeds=(0,),
        )[1]  # fmt: skip

    assert chosen("quick") == CHECKS
    assert chosen("smoke") == tuple(check for check in CHECKS if check.smoke)
    assert [check.name for check in chosen("smoke", ["slit_annulus_inner"])] == ["slit_annulus_inner"]


@pytest.mark.parametrize(
    ("found", "expected", "tolerance", "status"),
    [
        (1.0, 1.0, 0.0, "ok"),
        (1.2, 1.0, 0.1, "failed"),
        ((1.2, 1.15), None, 0.1, "ok"),
        ((1.2, 1.0), None, 0.1, "failed"),
        (7.0, None, None, "ok"),
        (7.0, 3.0, None, "ok"),
        (7.0, None, 0.1, "failed"),
        (math.nan, None, None, "failed"),
        (math.nan, 1.0, 0.1, "failed"),
    ],
)
def test_how_a_number_is_judged(monkeypatch, found, expected, tolerance, status):
    from benchmarks.checks import geometry

    monkeypatch.setattr(geometry, "torus_order", lambda: found)
    check = Check(
        name="planted", description="", reason="planted", module="geometry", function="torus_order",
        expected=expected, tolerance=tolerance,
    )  # fmt: skip
    row = run_check(check)
    assert row.status == status and (status == "ok" or row.reason)
    assert row.tolerance == tolerance
    if isinstance(found, tuple):
        assert (row.value, row.expected) == found
    broken = run_check(dataclasses.replace(check, function="nothing"))
    assert broken.status == "failed" and "nothing" in broken.reason


def test_order_is_the_slope():
    assert order([4e-3, 1e-3, 2.5e-4], [1, 0.5, 0.25]) == pytest.approx(2)
    assert math.isnan(order([1.0, 0.0], [1, 0.5])) and math.isnan(order([1.0, math.inf], [1, 0.5]))
