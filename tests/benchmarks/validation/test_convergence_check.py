"""The check of what a minimiser claims: it catches every kind of lie that one could tell."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from benchmarks.validation import convergence_check
from benchmarks.validation.convergence_check import (
    check_result,
    collapse_energies,
    lbfgs_then_newton,
    optimality_of,
    solve_and_check,
    undetermined_energy,
)
from benchmarks.validation.extreme_steps import sheet_step
from reference_sim import Potential, Result, minimise
from reference_sim.energies import BendHinge, StretchStVK


def claiming(positions, status="converged"):
    return Result(positions, status, "so it says", 1, 1, 0.0, 0.0, {})


def held_by_hinges(cloth, face):
    """[J] of a face inside a sheet whose three hinges are shut: k/2 pi^2 l^2 / (4 (A1 + A2)) each."""
    x, total = cloth.rest_positions, 0.0
    for i, j in np.stack([face, np.roll(face, -1)], axis=1):
        sides = [f for f in cloth.faces if i in f and j in f]
        areas = [np.linalg.norm(np.cross(x[b] - x[a], x[c] - x[a])) / 2 for a, b, c in sides]
        total += 0.5 * 3.96e-5 * np.pi**2 * np.sum((x[i] - x[j]) ** 2) / (4 * sum(areas))
    return total


@pytest.fixture(scope="module")
def solved():
    """An ordinary step and its true answer."""
    step = sheet_step()
    return step, minimise(step.potential, step.guess, tolerance=1e-9)


def test_the_truth_passes(solved):
    step, result = solved
    checked = check_result(step, result)
    assert checked.status == "ok" and checked.value <= 1e-6 and "iterations" in checked.reason
    assert set(checked.terms.split("+")) == {"strain", "bending", "gravity", "inertia"}


def test_a_false_claim_of_a_small_gradient_is_found(solved):
    step, result = solved
    near = result.positions + 1e-6 * (np.arange(81)[:, None] % 7 == 3)
    for x in (step.guess, near):
        checked = check_result(step, claiming(x))
        assert checked.status == "failed" and checked.value > 1e-6
        assert "claims convergence at a relative residual" in checked.reason


def test_a_saddle_called_converged_is_found():
    step = sheet_step(start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0)
    checked = check_result(step, claiming(step.guess))
    assert checked.status == "failed" and "saddle" in checked.reason and checked.value == 0.0


def test_a_saddle_far_below_the_stiffness_of_the_membrane_is_found():
    """A flat sheet pressed by a hair: the curvature that makes it buckle is far below the membrane's own."""
    cloth_step = sheet_step(gravity=0.0, speed=0.0, start="flat", dt=None, bending=2e-5, pins="side")
    flat = cloth_step.guess * [0.99999, 1.0, 0.99999]
    flat[cloth_step.pins] = cloth_step.guess[cloth_step.pins]
    truth = optimality_of(cloth_step, flat)
    assert -1e-2 < truth.lowest_curvature < -truth.zero_curvature


@pytest.mark.parametrize("status", ["converged", "stalled"])
def test_nan_is_found_whatever_it_is_called(solved, status):
    step, result = solved
    x = result.positions.copy()
    x[40, 1] = np.nan
    checked = check_result(step, claiming(x, status))
    assert checked.status == "failed" and "not finite" in checked.reason


def test_moved_pins_are_found(solved):
    step, result = solved
    x = result.positions.copy()
    x[step.pins[0]] += 1e-9
    assert check_result(step, claiming(x)).reason == "pinned vertices moved"


def test_a_rise_of_the_energy_is_found_at_the_end_and_on_the_way(solved):
    step, result = solved
    far = 3 * step.guess
    far[step.pins] = step.guess[step.pins]
    assert "rose" in check_result(step, claiming(far, "stalled")).reason
    there_and_back = [step.guess, result.positions, 0.5 * (step.guess + result.positions)]
    checked = check_result(step, result, there_and_back)
    assert checked.status == "failed" and re.search(r"rose from \S+ to \S+ J at step 2", checked.reason)
    # By 1e-11 of the energy: less than any picture shows, more than round-off.
    size = abs(step.potential.value(result.positions))
    slightly = result.positions.copy()
    while step.potential.value(slightly) < step.potential.value(result.positions) + 1e-11 * size:
        slightly += 1e-9 * (np.arange(81)[:, None] == 44)
    assert "rose" in check_result(step, result, [step.guess, result.positions, slightly]).reason


def test_an_honest_failure_keeps_its_name_and_says_what_collapsed(solved):
    step, _ = solved
    cut = minimise(step.potential, step.guess, max_iterations=2)
    checked = check_result(step, cut)
    assert checked.status == "stalled" and checked.value > 1e-6 and "gave up after 2" in checked.reason
    crushed = dataclasses.replace(step, guess=1e-3 * step.guess)
    lost = check_result(crushed, claiming(crushed.guess, "stalled")).reason
    assert re.search(r"; 1\d\d triangles have collapsed", lost) and "area barrier" in lost
    assert "collapse pays" not in lost
    nameless = solve_and_check(sheet_step(start="point", pins="none", speed=0.0))
    assert nameless.status == "diverged" and nameless.value is None and "not finite" in nameless.reason


def test_where_collapse_pays_is_a_matter_of_two_numbers():
    """A case without a minimum has a triangle whose collapse pays; the ordinary sheet is far from that."""
    for options in ({"stiffness": 1e-2}, {"terms": "bending"}, {"bending": 1e4}, {"bending": 100.0}):
        cost, gain = collapse_energies(sheet_step(**options).potential)
        assert (gain > cost).any(), options
    ordinary = sheet_step().potential
    cost, gain = collapse_energies(ordinary)
    assert (gain < 0.1 * cost).all()
    # A triangle in the middle of the sheet has three hinges, and a membrane of lambda + mu over 2 per area.
    assert gain[60] == pytest.approx(held_by_hinges(ordinary.cloth, ordinary.cloth.faces[60]))
    unscaled = BendHinge(ordinary.cloth, scaling="none")  # as the paper prints it
    printed = collapse_energies(Potential([StretchStVK(ordinary.cloth), unscaled]))[1]
    assert printed.max() == pytest.approx(3 * 0.5 * 3.96e-5 * np.pi**2)
    assert cost.sum() == pytest.approx(0.5 * (20.864 + 11.077) * 0.16, rel=1e-3)
    soft = sheet_step(stiffness=1e-3)
    assert "collapse pays" in check_result(soft, claiming(soft.guess, "stalled")).reason
    barrier = sheet_step(stiffness=1e-3, terms="membrane+bending+area")
    assert "collapse pays" not in check_result(barrier, claiming(barrier.guess, "stalled")).reason


def test_the_simulators_own_way_is_watched_from_start_to_end(solved):
    step, _ = solved
    kept = []
    result = lbfgs_then_newton(step.potential, step.guess, tolerance=1e-6, observe=kept.append)
    assert np.array_equal(kept[0], step.guess) and np.array_equal(kept[-1], result.positions)
    values = [step.potential.value(x) for x in kept]
    assert len(kept) > 5 and (np.diff(values) < 1e-12 * values[0]).all()
    assert solve_and_check(step).status == "ok"


def test_energy_that_round_off_decides_upon_is_that_of_hinges_of_flat_triangles(solved):
    step, result = solved
    cloth = step.potential.cloth
    here = undetermined_energy(step.potential, result.positions)
    assert 0.0 < here < 1e-9 * held_by_hinges(cloth, cloth.faces[60])
    far = undetermined_energy(step.potential, result.positions + 1e3)  # a kilometre: coordinates know less
    assert 1e3 * here < far < 1e-5
    a, b, c = cloth.faces[60]
    flat = result.positions.copy()
    flat[c] = 0.5 * (flat[a] + flat[b])  # its three hinges, and those of no other triangle
    assert undetermined_energy(step.potential, flat) == pytest.approx(held_by_hinges(cloth, cloth.faces[60]))


def test_the_check_uses_no_kernel(solved, monkeypatch):
    """With every kernel of the membrane returning nonsense the examination is the same."""
    step, result = solved
    before = optimality_of(step, result.positions)
    monkeypatch.setattr(StretchStVK, "value_and_gradient", None)
    monkeypatch.setattr(StretchStVK, "add_hessian", None)
    assert optimality_of(step, result.positions) == before


def test_a_minimiser_that_lies_is_caught_by_what_the_suite_runs(solved, monkeypatch):
    """The same way that a case goes, with fakes in the place of the solver."""
    step, _ = solved
    point = sheet_step(start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0)

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
    for case, solve, message in lies:
        monkeypatch.setattr(convergence_check, "lbfgs_then_newton", solve)
        checked = solve_and_check(case)
        assert checked.status == "failed" and message in checked.reason, (solve, checked)
