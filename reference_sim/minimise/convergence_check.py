"""The test of a minimum by its curvature, before Newton's method says converged, and the way off a saddle."""

from __future__ import annotations

import numpy as np

from reference_sim.minimise.factorised import FactorisedDescent
from reference_sim.minimise.lbfgs_history import dot
from reference_sim.minimise.result import Stop

POWER = 8  # inverse iterations for the direction of most negative curvature
FIRST_ESCAPE = 100  # of the step tolerance: first length of the step along it
LAST_SHIFT = 1e12  # in units of M/dt^2


def convergence_check(
    run: FactorisedDescent,
    values: np.ndarray,
    *,
    tolerance: float,
    step_tolerance: float,
    round_off: float = 0.0,
) -> Stop | None:
    """Return "converged", "stalled" on a saddle, or None to go on, where the gradient of `run` is small.

    Asks whether the true Hessian is positive definite (up to round-off, so that rigid motions of an unpinned
    cloth do not count) and its step small. Off a saddle it takes a step, which is an iteration.

    Args:
        run: the minimisation.
        values: (nnz,) values of its true Hessian.
        tolerance: relative residual [1]; above it, round-off excuses the residual.
        step_tolerance: largest Newton step [m] that counts as none.
        round_off: of the residual [1]; where it is above the tolerance, the reason says so.
    """
    residual = run.gradient_norm()
    relaxed = max(residual, round_off) > tolerance
    why = "gradient within tolerance"
    if residual > tolerance:
        why = f"round-off: residual {residual:.1e} above tolerance {tolerance:.1e}"
    elif relaxed:
        why = f"round-off: up to {round_off:.1e} in the residual, {residual:.1e}, tolerance {tolerance:.1e}"
    if run.factorise(values, run.hessian.tiny_shift(values)):
        step = float(np.abs(run.solve(-run.g)).max(initial=0.0))
        small = step <= step_tolerance or residual == 0.0
        if not small and run.factorise(values, 0.0):
            return None
        # Without curvature no step can be told from another.
        evidence = f"Newton step {step:.1e} m" if small else "a direction without curvature"
        return Stop("converged", f"{why}, {evidence}", relaxed)
    if escape_saddle(run, values, FIRST_ESCAPE * step_tolerance):
        run.iterations += 1
        run.show()
        return None
    return Stop("stalled", "a saddle: negative curvature, and no step along it lowers the energy")


def escape_saddle(run: FactorisedDescent, values: np.ndarray, length: float) -> bool:
    """Step along the direction of most negative curvature.

    length: of the first step tried [m]. Returns whether the energy fell.
    """
    v = most_negative(run, values)
    if v is None:
        return False
    v *= -1.0 if dot(v, run.g) > 0 else 1.0
    step = run.spread(length * v)
    scale = run.potential.largest_step(run.x, step)
    for _ in range(30):
        trial = run.x + scale * step
        value, gradient = run.evaluate(trial)
        if np.isfinite(value) and value < run.value - 1e-13 * abs(run.value):
            run.x, run.value, run.g = trial, value, gradient
            return True
        scale *= 0.5
    return False


def most_negative(run: FactorisedDescent, values: np.ndarray) -> np.ndarray | None:
    """Return the direction (3n,) of most negative curvature by inverse iteration.

    None if no shift outdoes it.
    """
    shift = 1.0
    while not run.factorise(values, shift):
        shift *= 4
        if shift > LAST_SHIFT:
            return None
    v = np.random.default_rng(0).standard_normal(len(run.g))
    for _ in range(POWER):
        v = run.solve(run.hessian.metric * v)
        v = v / np.abs(v).max()
    return v
