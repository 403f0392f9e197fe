"""Stress tests: the solver copes, and of a step that nobody chose it tells no lie."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.validation.convergence_check import RELATIVE_RESIDUAL, check_result
from benchmarks.validation.extreme_steps import (
    BODIES,
    PINS,
    REST_SHAPES,
    STARTS,
    VELOCITIES,
    sheet_step,
    solve_sheet,
)
from reference_sim import minimise


@pytest.mark.parametrize(("factor", "most"), [(1e3, 60), (1e4, 60), (1e6, 80)])
def test_stiff_cloth_converges_in_tens_of_iterations(factor, most):
    """Without predicted stresses and watchdog steps: 99 iterations at x1e3, more than 300 beyond."""
    step = sheet_step(stiffness=factor)
    result = minimise(*step, tolerance=RELATIVE_RESIDUAL)
    checked = check_result(*step, result)
    assert checked.status == "ok" and result.iterations <= most, checked


def test_the_hessian_is_the_true_one_again_after_a_run_that_was_cut():
    potential, guess = sheet_step(stiffness=1e4)
    before = potential.hessian(guess).toarray()
    for cut in (1, 3, 7):
        minimise(potential, guess, max_iterations=cut)
        assert np.array_equal(potential.hessian(guess).toarray(), before)


def drawn(seed: int) -> dict[str, object]:
    """A step of a sheet that nobody has chosen: every option of `sheet` drawn, factors over decades."""
    random = np.random.default_rng(seed)

    def factor(low: float, high: float) -> float:
        return float(10 ** random.uniform(low, high))

    def one_of(values):
        return values[random.integers(len(values))]

    terms = one_of(["membrane", "membrane+bending", "membrane+bending+area", "membrane+area"])
    return {
        "stiffness": factor(-3, 5), "bending": factor(-3, 5), "pins": one_of(list(PINS)),
        "gravity": one_of([0.0, 1.0, factor(0, 3)]), "dt": one_of([None, factor(-4, 1), factor(-4, 1)]),
        "shape": one_of(list(REST_SHAPES)), "start": one_of(list(STARTS)),
        "speed": one_of([0.0, factor(-1, 3), *VELOCITIES]), "rest_angles": one_of([0.0, 1.0, "random"]),
        "terms": terms, "body": one_of(["", *BODIES]),
    }  # fmt: skip


@pytest.mark.parametrize(
    "seeds",
    [range(6), *(pytest.param(range(k, k + 25), marks=pytest.mark.slow) for k in range(1000, 1500, 25))],
    ids=lambda seeds: str(seeds[0]),
)
def test_a_step_that_nobody_chose_is_no_lie_either(seeds):
    """Claims are checked from the definitions, contact included; a failure has to be said."""
    for seed in seeds:
        row = solve_sheet(**drawn(seed))
        assert row.status in ("ok", "stalled", "timeout", "diverged") and row.reason, (
            seed,
            drawn(seed),
            row,
        )
