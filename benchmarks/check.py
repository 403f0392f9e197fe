"""A check: one number whose value is known before anything is computed, or one that is only reported."""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass

from .results import Row

METHOD = "simulation"


@dataclass(frozen=True, kw_only=True)
class Check:
    """One number: what it is, what it must be and how far it may be off. `reason` defends the tolerance.

    `function` of benchmarks.checks.<module>, called with `arguments`, measures it. Where the reference has to
    be solved first, the function returns (measured, expected) and `expected` here is None. Without a
    tolerance the number is reported and judged by nobody. `smoke` marks those that the smallest preset runs.
    """

    name: str
    description: str
    unit: str = "1"
    expected: float | None = None
    tolerance: float | None = None
    reason: str
    module: str
    function: str
    arguments: tuple[str | float, ...] = ()
    smoke: bool = False

    def measure(self) -> tuple[float, float | None]:
        """(measured, expected); slow ones take a few seconds."""
        function = getattr(importlib.import_module(f"benchmarks.checks.{self.module}"), self.function)
        found = function(*self.arguments)
        measured, expected = found if isinstance(found, tuple) else (found, self.expected)
        return float(measured), None if expected is None else float(expected)


def run_check(check: Check) -> Row:
    """The row of one check. What a check raises becomes a failed row with the reason."""
    try:
        value, expected = check.measure()
    except Exception as error:
        return _row(check, None, check.expected, "failed", f"{type(error).__name__}: {error}")
    if not math.isfinite(value):
        return _row(check, None, expected, "failed", f"the measured number is {value}")
    if check.tolerance is None:
        return _row(check, value, expected, "ok", "")
    if expected is None:
        return _row(check, value, None, "failed", "a tolerance, but nothing to compare with")
    if abs(value - expected) <= check.tolerance:
        return _row(check, value, expected, "ok", "")
    far = f"{value:.6g} is further than {check.tolerance:g} from {expected:g} ({check.reason})"
    return _row(check, value, expected, "failed", far)


def _row(check: Check, value: float | None, expected: float | None, status: str, reason: str) -> Row:
    return Row(
        suite="validation",
        scene=check.name,
        method=METHOD,
        seed=0,
        metric="check",
        unit=check.unit,
        value=value,
        status=status,
        reason=reason,
        expected=expected,
        tolerance=check.tolerance,
    )
