"""Audit of engines: known answers by fake engines, the reference, and the true engines where installed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.engines import laws
from benchmarks.engines.engine import ITERATIONS, SUBSTEPS, EngineCloth
from benchmarks.engines.registry import ENGINES, REFERENCE, find_engine
from benchmarks.engines.roll_outs import EngineDiverged, roll_out
from benchmarks.engines.specimens import specimen
from benchmarks.validation.engines import audit
from benchmarks.validation.engines.cases import CASES
from reference_sim.energies import StretchStVK
from reference_sim.material import GRAVITY
from reference_sim.minimise.newton import Newton


class Falling(EngineCloth):
    """Free particles whose gravity and velocity are multiplied by what a fault would."""

    def __init__(self, gravity=1.0, kept=1.0):
        self.gravity, self.kept = gravity, kept

    def advance(self, x, v, dt):
        v = self.kept * (v - [0.0, self.gravity * GRAVITY * dt, 0.0])
        return x + dt * v, v


def fake(**fault):
    return dataclasses.replace(REFERENCE, substeps=4, make=lambda sample, iterations: Falling(**fault))


def test_backward_eulers_free_fall_is_exact_and_a_halved_one_a_violation():
    exact = roll_out(fake(), specimen("falling"))
    assert laws.fall_over_discrete_law(exact) == pytest.approx(1.0, abs=1e-12)
    assert laws.fall_over_continuous_law(exact) == pytest.approx(121 / 120, abs=1e-12)
    halved = roll_out(fake(gravity=0.5), specimen("falling"))
    assert laws.fall_over_discrete_law(halved) == pytest.approx(0.5, abs=1e-12)


def test_damped_velocity_violates_momentum():
    assert laws.momentum_error(roll_out(fake(), specimen("thrown"))) < 1e-10
    n = np.arange(1, 121)
    expected = 100 * (1 - (0.998**n).mean())
    damped = laws.momentum_error(roll_out(fake(kept=0.998), specimen("thrown")))
    assert damped == pytest.approx(expected, rel=1e-9)


def test_asymmetry_is_that_of_one_moved_vertex():
    run = roll_out(fake(), specimen("hanging"))
    assert laws.asymmetry(run) < 1e-10
    moved = run.positions.copy()
    moved[5, 3, 2] += 0.1
    crooked = dataclasses.replace(run, positions=moved)
    assert laws.asymmetry(crooked) == pytest.approx(10.0 / laws.motion(crooked), rel=1e-6)


class Bouncing(EngineCloth):
    """Strip whose free part bounces as one mass on a spring; it tells `scale` times the force of its pins."""

    RATE = 20.0  # [1/s] of the spring

    def __init__(self, sample, explicit, scale=1.0):
        self.start, self.cloth = sample.start, sample.cloth
        self.free = np.setdiff1d(np.arange(len(self.start)), self.cloth.pins)
        self.energies, self.explicit, self.scale = (self,), explicit, scale

    def value_and_gradient(self, x):
        force = self.cloth.masses[self.free].sum() * self.RATE**2 * self.sag(x)
        gradient = np.zeros_like(x)
        gradient[self.cloth.pins, 1] = self.scale * force / len(self.cloth.pins)
        return 0.5 * force * self.sag(x), gradient

    def sag(self, x):
        return (self.start - x)[self.free, 1].mean()

    def advance(self, x, v, dt):
        v = v.copy()
        v[self.free, 1] += dt * (self.RATE**2 * self.sag(x) - GRAVITY)
        if not self.explicit:
            v[self.free, 1] /= 1 + (dt * self.RATE) ** 2
        return x + dt * v, v


@pytest.mark.parametrize("explicit", [False, True])
def test_pins_carry_weight_and_inertia_of_a_strip_that_bounces(explicit):
    def reaction(scale):
        engine = dataclasses.replace(
            REFERENCE, substeps=20, make=lambda sample, iterations: Bouncing(sample, explicit, scale)
        )
        return laws.reaction_over_weight(roll_out(engine, specimen("strip")))

    assert reaction(1.0) == pytest.approx(1.0, abs=1e-9)
    cloth = specimen("strip").cloth
    free = 1.0 - cloth.masses[cloth.pins].sum() / cloth.masses.sum()
    assert reaction(1.01) == pytest.approx(1.0 + 0.01 * free, abs=1e-4)


def test_without_energies_the_reaction_is_that_of_the_centre():
    run = roll_out(fake(), specimen("strip"))
    assert laws.reaction_over_weight(run) == pytest.approx(0.0, abs=1e-9)


def test_an_engine_that_explodes_says_when():
    with pytest.raises(EngineDiverged, match="frame 1: a vertex"):
        roll_out(fake(gravity=1e9), specimen("falling"))


def test_what_compiles_in_a_late_frame_is_not_timed(monkeypatch):
    clock = [0.0]

    class Compiling(Falling):
        steps = 0

        def advance(self, x, v, dt):
            self.steps += 1
            clock[0] += 100.0 if self.steps == 40 else 1.0
            return super().advance(x, v, dt)

    monkeypatch.setattr("benchmarks.engines.roll_outs.time.process_time", lambda: clock[0])
    engine = dataclasses.replace(REFERENCE, substeps=4, make=lambda sample, iterations: Compiling())
    assert roll_out(engine, specimen("falling")).seconds == pytest.approx(4.0)


def test_a_gap_to_a_minimum_that_was_not_found_is_no_number(monkeypatch):
    run = roll_out(fake(), specimen("hanging"))
    run = dataclasses.replace(run, energies=(StretchStVK(run.specimen.cloth),))
    monkeypatch.setattr(laws, "Newton", lambda potential, **options: Newton(potential, max_iterations=1))
    with pytest.raises(RuntimeError, match="the minimum of a step is not known: max_iterations"):
        laws.energy_gap(run)


@pytest.mark.parametrize("sample", ["falling", "thrown", pytest.param("hanging", marks=pytest.mark.slow)])
def test_the_reference_keeps_all_laws(sample):
    laws = [case for case in CASES if case.method == "reference" and case.options.get("sample") == sample]
    for case in laws:
        row = case.run()
        assert row.status == "ok", row.reason
        assert row.tolerance is None or abs(row.value - row.expected) < 1e-3 * row.tolerance
        assert "MIT" in row.reason and row.method == "reference"
    assert laws


def test_the_least_budget_is_one_from_which_all_are_near():
    run = roll_out(fake(), specimen("falling"))
    far = dataclasses.replace(run, positions=run.positions + 0.5 * (run.positions - run.positions[:1]))
    assert audit._within({1: far, 4: run, 16: run}, 1.0) == 4
    assert audit._within({1: run, 4: far, 16: run}, 1.0) is None


def test_a_budget_that_is_not_near_says_how_far_the_last_two_are_apart_and_what_was_counted(monkeypatch):
    run = roll_out(fake(), specimen("falling"))
    far = dataclasses.replace(run, positions=run.positions + 0.5 * (run.positions - run.positions[:1]))
    monkeypatch.setattr(audit, "ladder", lambda name: ({1: far, 4: run}, "its last two budgets differ"))
    monkeypatch.setattr(audit, "reference_ladder", lambda substeps: {1: run, 4: far, 16: run})
    engine = find_engine("mujoco.euler")
    assert audit.converged_budget.__wrapped__(engine) == (
        None,
        "no budget is within 1 %; its last two budgets differ",
    )
    for grows, unit in ((ITERATIONS, "iterations a step"), (SUBSTEPS, "steps a frame")):
        engine = dataclasses.replace(engine, grows=grows)
        assert audit.reference_milliseconds.__wrapped__(engine) == (
            None,
            f"the reference is not within 1 % at 4 {unit}",
        )


def test_an_absent_engine_is_skipped_with_its_command(monkeypatch):
    absent = dataclasses.replace(find_engine("mujoco.euler"), module="no_such_package")
    monkeypatch.setattr(audit, "find_engine", lambda name: absent)
    row = next(case for case in CASES if case.name == "mujoco.euler.budget").run()
    assert row.status == "skipped"
    assert row.reason == "MuJoCo, Euler is not installed: pip install 'neural-garment-benchmark[engines]'"


def test_cases_of_an_engine_share_a_process_and_each_is_a_row_of_its_own():
    assert {case.process for case in CASES} == {f"engine-{engine.name}" for engine in ENGINES}
    assert len({case.name for case in CASES}) == len(CASES) == len({(c.scene, c.metric) for c in CASES})


@pytest.mark.slow
def test_mujoco_falls_as_it_should_and_its_pins_hold_the_weight():
    pytest.importorskip("mujoco", reason="needs the extra `engines`")
    engine = find_engine("mujoco.euler")
    assert laws.fall_over_discrete_law(roll_out(engine, specimen("falling"))) == pytest.approx(1, abs=1e-6)
    assert laws.reaction_over_weight(roll_out(engine, specimen("strip"))) == pytest.approx(1, abs=1e-6)


@pytest.mark.slow
def test_xpbds_pins_hold_the_weight_of_a_strip_that_bounces():
    pytest.importorskip("newton", reason="needs the extra `engines`")
    run = roll_out(find_engine("newton.xpbd"), specimen("strip"))
    assert laws.reaction_over_weight(run) == pytest.approx(1, abs=1e-3)


@pytest.mark.slow
def test_style3d_damps_a_free_fall():
    """It multiplies every velocity by 0.998, so that more steps fall less far."""
    pytest.importorskip("newton", reason="needs the extra `engines`")
    run = roll_out(find_engine("newton.style3d"), specimen("falling"))
    v, fallen = 0.0, 0.0
    for _ in range(120):
        v += GRAVITY * run.step
        fallen += v * run.step
        v *= 0.998
    assert -laws.centre(run)[-1, 1] == pytest.approx(fallen, rel=1e-3)
