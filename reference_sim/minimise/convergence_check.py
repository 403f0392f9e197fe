"""What Newton's method asks before it says converged, and the way out of a saddle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .factorised import FactorisedDescent
from .lbfgs_history import dot
from .result import Result

POWER = 8  # inverse iterations for the direction of most negative curvature
FIRST_ESCAPE = 100  # of the step tolerance: first length of the step along it
LAST_SHIFT = 1e12  # in units of M/dt^2


def convergence_check(
    run: FactorisedDescent, data: np.ndarray, *, tolerance: float, step_tolerance: float
) -> Result | None:
    """Converged, stuck on a saddle, or None: go on. The gradient of `run` is small; data: its true Hessian.

    What is left to ask is whether that is positive definite (up to round-off, so that rigid motions of an
    unpinned cloth do not count) and its step below step_tolerance [m].
    """
    residual = run.gradient_norm()
    relaxed = residual > tolerance
    why = "gradient within tolerance"
    if relaxed:
        why = f"round-off: residual {residual:.1e} above tolerance {tolerance:.1e}"
    if run.factorise(data, run.hessian.tiny_shift(data)):
        step = float(np.abs(run.solve(-run.g)).max(initial=0.0))
        if step <= step_tolerance or residual == 0.0:
            return replace(run.result("converged", f"{why}, Newton step {step:.1e} m"), relaxed=relaxed)
        if not run.factorise(data, 0.0):  # no step along such a direction can be told from another
            return replace(run.result("converged", f"{why}, a direction without curvature"), relaxed=relaxed)
        return None
    if escape_saddle(run, data, FIRST_ESCAPE * step_tolerance):
        run.iterations += 1
        run.show()
        return None
    return run.result("stalled", "a saddle: negative curvature, and no step along it lowers the energy")


def escape_saddle(run: FactorisedDescent, data: np.ndarray, length: float) -> bool:
    """Step along the most negative curvature direction, found by inverse iteration.

    length: of the first step tried [m].
    """
    shift = 1.0
    while not run.factorise(data, shift):
        shift *= 4
        if shift > LAST_SHIFT:
            return False
    v = np.random.default_rng(0).standard_normal(len(run.g))
    for _ in range(POWER):
        v = run.solve(run.hessian.metric * v)
        v /= np.abs(v).max()
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
