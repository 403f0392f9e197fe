"""Planted regressions and planted noise: the gate catches the first and lets the second through."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.results.row import Row
from reports.comparison import FAILING, compare
from tests.reports.report_folder import row, run_of

SCENES = tuple(f"tshirt/motion_{k}" for k in range(8))
SEEDS = (0, 1, 2)
METRICS = {"energy/strain": 0.04, "curvature/error": 6.0, "penetration/vertices": 0.3}


def a_run(draw: int) -> list[Row]:
    """A network whose seeds scatter by 5 % alike in all motions and 10 % in each, a simulation, a solver."""
    random = np.random.default_rng(draw)
    rows = []
    for metric, size in METRICS.items():
        alike = random.normal(0.0, 0.05, len(SEEDS))
        for k, scene in enumerate(SCENES):
            level = size * (1.0 + 0.3 * k)
            values = level * np.exp(alike + random.normal(0.0, 0.1, len(SEEDS)))
            rows += [row(scene, "snug", metric, float(values[s]), seed=s) for s in SEEDS]
            rows.append(row(scene, "simulation", metric, 0.5 * level, uncertainty=0.005 * level))
    for scene in SCENES:
        for method, time in (("simulation", 60.0), ("skinning", 0.2)):
            value = time * float(np.exp(random.normal(0.0, 0.05)))
            rows.append(row(scene, method, "cost/frame", value, unit="ms"))
    for method, time in (("simulation", 60.0), ("lbfgs-5", 6.0)):
        rows.append(row("flag", method, "cost/frame", time, suite="speed", unit="ms"))
        rows.append(row("flag", method, "cost/spread", 3.0, suite="speed", unit="%"))
    # Of a scene without skinning, whose total is next to nothing.
    rows += [
        row("fall", method, "energy/total", 5e-8, suite="speed") for method in ("simulation", "lbfgs-5")
    ]
    return rows


def times(factor: float, **where: object) -> Callable[[Row], Row]:
    def change(given: Row) -> Row:
        fits = all(getattr(given, name) == value for name, value in where.items())
        return dataclasses.replace(given, value=factor * given.value) if fits else given

    return change


STRAIN = {"method": "snug", "metric": "energy/strain"}
PLANTED = {
    "strain three times on one of eight motions": times(3.0, scene=SCENES[0], **STRAIN),
    "strain ten times on one motion": times(10.0, scene=SCENES[5], **STRAIN),
    "strain 1.3 times on all motions": times(1.3, **STRAIN),
    "the simulation's strain 6 % more on one motion": times(
        1.06, scene=SCENES[3], method="simulation", metric="energy/strain"
    ),
    "simulation five times as slow, timed once": times(
        5.0, method="simulation", metric="cost/frame", suite="garments"
    ),
    "skinning five times as slow, timed once": times(5.0, method="skinning", metric="cost/frame"),
    "a solver 1.3 times as slow, repeated": times(1.3, method="lbfgs-5", metric="cost/frame"),
}
LOST = {
    "a method": lambda given: given.method != "skinning",
    "a seed": lambda given: (given.method, given.seed) != ("snug", 2),
    "a motion": lambda given: given.scene != SCENES[2],
    "a metric of a method": lambda given: (given.method, given.metric) != ("snug", "curvature/error"),
}


def fails(before: list[Row], after: list[Row]) -> bool:
    return any(
        change.verdict in (*FAILING, "changed")
        for change in compare(run_of(before), run_of(after)).changes
    )


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_regression_is_caught(name):
    assert fails(a_run(0), [PLANTED[name](given) for given in a_run(1)])


@pytest.mark.parametrize("name", LOST)
def test_what_is_gone_is_caught_and_named_once(name):
    after = [given for given in a_run(1) if LOST[name](given)]
    changes = compare(run_of(a_run(0)), run_of(after)).changes
    assert changes and {change.verdict for change in changes} == {"gone"} and len(changes) <= 3
    assert compare(run_of(a_run(0)), run_of(after), shared=True).changes == ()


def test_other_seeds_other_times_and_round_off_are_no_change():
    alarms = sum(fails(a_run(2 * k), a_run(2 * k + 1)) for k in range(6))
    assert alarms == 0
    tiny = [times(1.0 - 1e-6, metric="energy/total")(given) for given in a_run(0)]
    assert not fails(a_run(0), tiny)


def test_a_motion_on_which_seeds_disagree_hides_no_change_of_another():
    broken = {"scene": SCENES[6], "seed": 1} | STRAIN
    before, after = ([times(40.0, **broken)(given) for given in a_run(draw)] for draw in (0, 1))
    assert not fails(before, after)
    assert fails(before, [times(3.0, scene=SCENES[0], **STRAIN)(given) for given in after])


def test_a_repeated_time_is_compared_with_the_range_of_its_repeats():
    def spread(given: Row) -> Row:
        wide = given.metric == "cost/spread"
        return dataclasses.replace(given, value=12.0) if wide else given

    before = [spread(given) for given in a_run(0)]
    slower = {factor: times(factor, method="lbfgs-5", metric="cost/frame") for factor in (1.17, 1.5)}
    assert not fails(before, [slower[1.17](given) for given in before])
    assert fails(before, [slower[1.5](given) for given in before])
