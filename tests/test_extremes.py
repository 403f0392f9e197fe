"""Suite extremes: its cases, what becomes of one that fails, its tables, and that the solver copes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from meshes import grid

from benchmarks.checks import refusals
from benchmarks.checks.hard_steps import sheet
from benchmarks.checks.starts import START, VELOCITIES
from benchmarks.checks.verdict import attempt
from benchmarks.guarded import Broken
from benchmarks.results import Row
from benchmarks.suites import extremes
from reference_sim import Cloth, minimise
from reference_sim.energies import Energy, StretchStVK
from reports import stability

SMOKE = [case for case in extremes.CASES if case.smoke]


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
    """Without predicted stresses and watchdog steps: 99 iterations at x1e3, more than 300 beyond."""
    verdict = attempt(sheet(stiffness=factor))
    assert verdict.status == "ok" and verdict.iterations <= most, verdict


@pytest.mark.slow
@pytest.mark.parametrize("case", extremes.STEPS, ids=lambda case: case.name)
def test_an_extreme_case_never_lies(case):
    row = extremes.run_case(case)
    assert row.status in ("ok", "stalled", "timeout", "diverged") and row.reason, row.reason


def test_predicted_stress_is_linear_in_the_step_and_forgotten():
    x, faces = grid(3, 3, width=0.3, depth=0.3)
    cloth = Cloth(x, faces)
    random = np.random.default_rng(4)
    x = x + random.normal(0, 0.01, x.shape)
    step = random.normal(0, 0.05, x.shape)
    energy = StretchStVK(cloth)
    true = energy.hessian_blocks(x)
    energy.predict_stress(x, step)
    predicted = energy.hessian_blocks(x + step)
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
    assert predicted == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert np.abs(predicted - there).max() > 0.01 * np.abs(there).max()


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
