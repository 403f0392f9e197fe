"""Suite extremes: its judge catches every kind of lie, its worker every hang, and the solver copes."""

from __future__ import annotations

import dataclasses
import operator
import os
import re
import time

import numpy as np
import pytest
from meshes import grid

from benchmarks.checks import refusals
from benchmarks.checks.hard_steps import sheet
from benchmarks.checks.starts import START, VELOCITIES
from benchmarks.checks.verdict import as_simulated, attempt, examine, judge, price_of_collapse, unknown_energy
from benchmarks.guarded import Broken, Guarded
from benchmarks.results import Row
from benchmarks.suites import extremes
from reference_sim import Cloth, Result, minimise
from reference_sim.energies import Energy, StretchStVK
from reports import stability

SMOKE = [case for case in extremes.CASES if case.smoke]


def claiming(positions, status="converged"):
    return Result(positions, status, "so it says", 1, 1, 0.0, 0.0, {})


@pytest.fixture(scope="module")
def solved():
    """An ordinary step and its true answer."""
    step = sheet()
    return step, minimise(step.potential, step.guess, tolerance=1e-9)


# --- liars ----------------------------------------------------------------------------------------------


def test_the_truth_passes(solved):
    step, result = solved
    verdict = judge(step, result)
    assert verdict.status == "ok" and verdict.value <= 1e-6 and "iterations" in verdict.reason
    assert set(verdict.terms.split("+")) == {"strain", "bending", "gravity", "inertia"}


def test_a_false_claim_of_a_small_gradient_is_found(solved):
    step, result = solved
    near = result.positions + 1e-6 * (np.arange(81)[:, None] % 7 == 3)
    for x in (step.guess, near):
        verdict = judge(step, claiming(x))
        assert verdict.status == "failed" and verdict.value > 1e-6
        assert "claims convergence at a gradient" in verdict.reason


def test_a_saddle_called_converged_is_found():
    step = sheet(start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0)
    verdict = judge(step, claiming(step.guess))
    assert verdict.status == "failed" and "saddle" in verdict.reason and verdict.value == 0.0


def test_a_saddle_far_below_the_stiffness_of_the_membrane_is_found():
    """A flat sheet pressed by a hair: the curvature that makes it buckle is far below the membrane's own."""
    cloth_step = sheet(gravity=0.0, speed=0.0, start="flat", dt=None, ratio=1e-8, pins="side")
    flat = cloth_step.guess * [0.99999, 1.0, 0.99999]
    flat[cloth_step.pins] = cloth_step.guess[cloth_step.pins]
    truth = examine(cloth_step, flat)
    assert -1e-2 < truth.lowest < -truth.flat


@pytest.mark.parametrize("status", ["converged", "stalled"])
def test_nan_is_found_whatever_it_is_called(solved, status):
    step, result = solved
    x = result.positions.copy()
    x[40, 1] = np.nan
    verdict = judge(step, claiming(x, status))
    assert verdict.status == "failed" and "not finite" in verdict.reason


def test_moved_pins_are_found(solved):
    step, result = solved
    x = result.positions.copy()
    x[step.pins[0]] += 1e-9
    assert judge(step, claiming(x)).reason == "pinned vertices moved"


def test_a_rise_of_the_energy_is_found_at_the_end_and_on_the_way(solved):
    step, result = solved
    far = 3 * step.guess
    far[step.pins] = step.guess[step.pins]
    assert "rose" in judge(step, claiming(far, "stalled")).reason
    there_and_back = [step.guess, result.positions, 0.5 * (step.guess + result.positions)]
    verdict = judge(step, result, there_and_back)
    assert verdict.status == "failed" and re.search(r"rose from \S+ to \S+ J at step 2", verdict.reason)
    # By 1e-11 of the energy: less than any picture shows, more than round-off.
    size = abs(step.potential.value(result.positions))
    slightly = result.positions.copy()
    while step.potential.value(slightly) < step.potential.value(result.positions) + 1e-11 * size:
        slightly += 1e-9 * (np.arange(81)[:, None] == 44)
    assert "rose" in judge(step, result, [step.guess, result.positions, slightly]).reason


def test_an_honest_failure_keeps_its_name_and_says_what_collapsed(solved):
    step, _ = solved
    cut = minimise(step.potential, step.guess, max_iterations=2)
    verdict = judge(step, cut)
    assert verdict.status == "stalled" and verdict.value > 1e-6 and "gave up after 2" in verdict.reason
    crushed = sheet(start="a thousandth")
    lost = judge(crushed, claiming(crushed.guess, "stalled")).reason
    assert re.search(r"; 1\d\d triangles have collapsed", lost) and "area barrier" in lost
    assert "collapse pays" not in lost
    nameless = attempt(sheet(start="point", pins="none", speed=0.0))
    assert nameless.status == "diverged" and nameless.value is None and "not finite" in nameless.reason


def test_where_collapse_pays_is_a_matter_of_two_numbers():
    """Of every case that does not converge for want of a minimum; the ordinary sheet is far from it."""
    for options in ({"stiffness": 1e-2}, {"terms": "bending"}, {"bending": 1e4}, {"bending": 100.0}):
        cost, gain = price_of_collapse(sheet(**options).potential)
        assert (gain > cost).any(), options
    cost, gain = price_of_collapse(sheet().potential)
    assert (gain < 0.1 * cost).all()
    # A triangle in the middle of the sheet has three hinges, and a membrane of lambda + mu over 2 per area.
    assert gain.max() == pytest.approx(3 * 0.5 * 3.96e-5 * np.pi**2)
    assert cost.sum() == pytest.approx(0.5 * (20.864 + 11.077) * 0.16, rel=1e-3)
    soft = sheet(stiffness=1e-3)
    assert "collapse pays" in judge(soft, claiming(soft.guess, "stalled")).reason
    barrier = sheet(stiffness=1e-3, terms="membrane+bending+area")
    assert "collapse pays" not in judge(barrier, claiming(barrier.guess, "stalled")).reason


def test_the_simulators_own_way_is_watched_from_start_to_end(solved):
    step, _ = solved
    kept = []
    result = as_simulated(step.potential, step.guess, tolerance=1e-6, observe=kept.append)
    assert np.array_equal(kept[0], step.guess) and np.array_equal(kept[-1], result.positions)
    values = [step.potential.value(x) for x in kept]
    assert len(kept) > 5 and (np.diff(values) < 1e-12 * values[0]).all()
    assert attempt(step, as_simulated).status == "ok"


def test_energy_that_round_off_decides_upon_is_that_of_hinges_of_flat_triangles(solved):
    step, result = solved
    assert unknown_energy(step.potential, result.positions) == 0.0
    a, b, c = step.potential.cloth.faces[60]
    flat = result.positions.copy()
    flat[c] = 0.5 * (flat[a] + flat[b])  # its three hinges, and those of no other triangle
    one = 0.5 * 3.96e-5 * np.pi**2
    assert unknown_energy(step.potential, flat) == pytest.approx(3 * one)


def test_the_judge_uses_no_kernel(solved, monkeypatch):
    """With every kernel of the membrane returning nonsense the examination is the same."""
    step, result = solved
    before = examine(step, result.positions)
    monkeypatch.setattr(StretchStVK, "value_and_gradient", None)
    monkeypatch.setattr(StretchStVK, "active_hessian_blocks", None)
    monkeypatch.setattr(StretchStVK, "hessian_blocks", None)
    assert examine(step, result.positions) == before


def test_a_minimiser_that_lies_is_caught_by_what_the_suite_runs(solved):
    """The same way that run_case goes, with fakes in the place of the solver."""
    step, _ = solved
    point = sheet(start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0)

    def standing(potential, x0, *, tolerance, timeout, observe):
        observe(x0)
        return claiming(x0)

    def vanishing(potential, x0, **options):
        return claiming(np.full_like(x0, np.nan), "stalled")

    def climbing(potential, x0, *, tolerance, timeout, observe):
        truth = minimise(potential, x0, tolerance=tolerance)
        for share in (0.0, 1.0, 0.9, 1.0):
            observe(x0 + share * (truth.positions - x0))
        return truth

    lies = [(point, standing, "saddle"), (step, standing, "claims convergence"),
            (step, vanishing, "not finite"), (step, climbing, "rose")]  # fmt: skip
    for case, solve, words in lies:
        verdict = attempt(case, solve)
        assert verdict.status == "failed" and words in verdict.reason, (solve, verdict)


# --- hangs and crashes ----------------------------------------------------------------------------------


def test_a_hang_and_a_crash_are_ended_and_the_next_work_is_done():
    with Guarded() as guarded:
        assert guarded.call(operator.mul, 2, 4, seconds=60) == 8
        began = time.monotonic()
        with pytest.raises(Broken, match=r"no answer within 0\.2 s"):
            guarded.call(time.sleep, 1000, seconds=0.2)
        assert time.monotonic() - began < 4.0
        with pytest.raises(Broken, match="ended with status 7"):
            guarded.call(os._exit, 7, seconds=60)
        with pytest.raises(ValueError, match="invalid literal"):
            guarded.call(int, "x", seconds=60)
        assert guarded.call(operator.mul, 2, 5, seconds=60) == 10


def test_a_process_that_cannot_start_is_none_at_all():
    with Guarded(lambda: None) as guarded:  # cannot be sent to it
        for _ in range(2):
            with pytest.raises(Exception, match="lambda"):
                guarded.call(operator.mul, 2, 4, seconds=1)


@pytest.mark.parametrize(("does", "words"), [("broken", "no answer"), ("wrong", "RuntimeError: lost")])
def test_what_did_not_come_back_is_a_failed_row(monkeypatch, does, words):
    class Lost:
        def call(self, *_, **__):
            raise Broken("no answer within 60 s") if does == "broken" else RuntimeError("lost")

    monkeypatch.setattr(extremes, "_guarded", Lost)
    row = extremes.run_case(SMOKE[0])
    assert row.status == "failed" and row.value is None and words in row.reason
    point = extremes.run_case(extremes.MAPS["map_sheet"][0])
    assert point.status == "failed" and point.unit == "iterations" and point.scene == "map_sheet"


# --- cases ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", SMOKE, ids=lambda case: case.name)
def test_a_case_of_the_smallest_preset_is_honest(case, monkeypatch):
    class Here:
        def call(self, function, *arguments, seconds):
            return function(*arguments)

    monkeypatch.setattr(extremes, "_guarded", Here)
    row = extremes.run_case(case)
    assert row.status == "ok", row.reason
    assert row.suite == "extremes" and row.scene == case.name and row.metric == case.metric


def test_there_are_enough_cases_and_each_can_be_built():
    assert len(extremes.STEPS) >= 60 and len(SMOKE) == 8 and len(extremes.MAPS) == 2
    names = [case.name for case in extremes.CASES]
    assert len(set(names)) == len(names)
    metrics = [(case.scene, case.metric) for cases in extremes.MAPS.values() for case in cases]
    assert len(set(metrics)) == len(metrics)
    used = {case.options.get("start", "noisy") for case in extremes.STEPS}
    assert used == set(START)
    fields = {case.options.get("speed") for case in extremes.STEPS}
    assert set(VELOCITIES) <= fields
    for case in extremes.STEPS:
        if case.function == "hard_steps:sheet":
            step = sheet(**case.options)
            assert step.guess.shape == (81, 3) and step.weight > 0, case.name


@pytest.mark.parametrize("case", extremes.REFUSALS, ids=lambda case: case.name)
def test_a_bad_input_is_refused_by_name(case):
    row = extremes.run_case(case)
    assert (row.status, row.value, row.metric) == ("ok", 1.0, "refusal"), row.reason


def test_what_is_taken_or_refused_without_a_name_fails(monkeypatch):
    case = extremes.REFUSALS[0]
    monkeypatch.setattr(refusals, "zero_area", lambda: None)
    row = extremes.run_case(case)
    assert (row.status, row.value, row.reason) == ("failed", 0.0, "was not refused")
    monkeypatch.setattr(refusals, "zero_area", lambda: int("x"))
    assert "without naming 'face 3'" in extremes.run_case(case).reason
    monkeypatch.setattr(refusals, "zero_area", lambda: 1 / 0)
    assert "ZeroDivisionError" in extremes.run_case(case).reason


# --- the report's part ----------------------------------------------------------------------------------


def point(factor, dt, status="ok", value=12.0):
    row = Row(
        "extremes", "map_sheet", "simulation", 0, f"map/{factor:g}/{dt:.3g}", "iterations", value, status
    )
    return dataclasses.replace(row, reason="why" if status != "ok" else "")


def test_a_map_of_every_outcome_is_drawn(tmp_path):
    statuses = ("ok", "stalled", "failed", "timeout", "diverged")
    rows = [point(10.0**k, dt, status) for k, status in enumerate(statuses) for dt in (1e-4, 1 / 30)]
    rows.append(dataclasses.replace(rows[0], metric="outcome", scene="another"))
    found = stability.points(rows)
    assert list(found) == ["map_sheet"] and len(found["map_sheet"]) == 10
    assert {(p.stiffness, p.dt) for p in found["map_sheet"]} >= {(1.0, 1e-4), (1e4, 0.0333)}
    (picture,) = stability.stability_maps(tmp_path, rows)
    assert picture.path.is_file() and picture.path.with_suffix(".png").is_file()
    assert stability.stability_maps(tmp_path, rows[-1:]) == []
    blues = [stability.shade(n)[0] for n in (1.0, 2.0, 20.0, 300.0, 1e6)]
    assert blues == sorted(blues, reverse=True) and blues[0] == blues[1] and blues[3] == blues[4]


def test_refused_inputs_have_a_table():
    rows = [extremes.run_case(case) for case in extremes.REFUSALS[:2]]
    table = stability.refusals(rows)
    assert [line[:2] for line in table.rows] == [("zero_area", "ok"), ("zero_area_uv", "ok")]
    assert stability.refusals([point(1.0, 1.0)]) is None


# --- the solver's part ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("factor", "most"), [(1e3, 60), (1e4, 60), (1e6, 80)])
def test_stiff_cloth_converges_in_tens_of_iterations(factor, most):
    """Without predicted stresses and excursions: 99 iterations at x1e3, more than 300 beyond."""
    verdict = attempt(sheet(stiffness=factor))
    assert verdict.status == "ok" and verdict.iterations <= most, verdict


@pytest.mark.slow
@pytest.mark.parametrize("case", extremes.STEPS, ids=lambda case: case.name)
def test_an_extreme_case_never_lies(case):
    row = extremes.run_case(case)
    assert row.status in ("ok", "stalled", "timeout", "diverged") and row.reason, row.reason


def test_foreseen_stress_is_linear_in_the_step_and_forgotten():
    x, faces = grid(3, 3, width=0.3, depth=0.3)
    cloth = Cloth(x, faces)
    random = np.random.default_rng(4)
    x = x + random.normal(0, 0.01, x.shape)
    step = random.normal(0, 0.05, x.shape)
    energy = StretchStVK(cloth)
    true = energy.hessian_blocks(x)
    energy.foresee(x, step)
    foreseen = energy.hessian_blocks(x + step)
    energy.forget()
    assert np.array_equal(energy.hessian_blocks(x), true)
    # From the definition: the part of the Hessian without stress, at x + step, plus the stress's own part
    # of the difference between S(x) + dS/dx step and S(x + step).
    there = Energy.hessian_blocks(energy, x + step)

    def strain(positions):
        corner = positions[cloth.faces]
        F = np.stack([corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]], axis=-1) @ cloth.Dm_inverse
        return 0.5 * (F.transpose(0, 2, 1) @ F - np.eye(2))

    # Strain is quadratic, so that a central difference is its derivative.
    missing = strain(x) + 0.5 * (strain(x + step) - strain(x - step)) - strain(x + step)
    m = cloth.material
    trace = np.einsum("fii->f", missing)[:, None, None]
    stress = m.lame_lambda * trace * np.eye(2) + 2 * m.lame_mu * missing
    b = np.concatenate([-cloth.Dm_inverse.sum(axis=1, keepdims=True), cloth.Dm_inverse], axis=1)
    part = cloth.areas[:, None, None] * np.einsum("fai,fij,fcj->fac", b, stress, b)
    expected = there + np.einsum("fac,ij->faicj", part, np.eye(3)).reshape(there.shape)
    assert foreseen == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert np.abs(foreseen - there).max() > 0.01 * np.abs(there).max()


def test_every_kept_point_is_observed_and_lower_than_the_one_before():
    step = sheet(start="very noisy")
    kept = []
    result = minimise(step.potential, step.guess, observe=kept.append)
    assert np.array_equal(kept[0], step.guess) and np.array_equal(kept[-1], result.positions)
    assert 2 < len(kept) <= result.iterations + 1  # an excursion's way is not kept, only its end
    values = np.array([step.potential.value(x) for x in kept])
    assert (np.diff(values) < 1e-13 * values[0]).all()


def test_the_hessian_is_the_true_one_again_after_a_run_that_was_cut():
    step = sheet(stiffness=1e4)
    before = step.potential.hessian(step.guess).toarray()
    for cut in (1, 3, 7):
        minimise(step.potential, step.guess, max_iterations=cut)
        assert np.array_equal(step.potential.hessian(step.guess).toarray(), before)
