"""Suite extremes: one hard step each. It has to converge truly, or to fail and say so.

What counts as passing: the energy did not rise, everything is finite, and a claim of convergence is true, by
a path that shares no kernel with the solver (benchmarks.checks.verdict). A false claim, a NaN, a crash and a
hang are failed rows; an honest "stalled", "diverged" or "timeout" keeps that name and its reason. Bad inputs
have to be refused with a message that names what is wrong with them. Two maps repeat one step over
stiffness and time step.

Every case runs in a process of its own kind, ended at a deadline.
"""

from __future__ import annotations

import atexit
import importlib
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ..guarded import Broken, Guarded
from ..results import Row
from .extreme_cases import CASES, MAPS, REFUSALS, STEPS, Case

if TYPE_CHECKING:
    from ..checks.verdict import Verdict

__all__ = ["CASES", "MAPS", "METHOD", "REFUSALS", "STEPS", "Case", "run_case"]

METHOD = "simulation"
TOLERANCE = 1e-6  # largest gradient component over the mean weight of a vertex
DEADLINE = 60.0  # [s] for one case, after which its process is ended
COMPILING = 900.0  # [s] for the first, which may have to compile every kernel


def run_case(case: Case) -> Row:
    """The row of one case."""
    value, status, reason, iterations, terms = None, "failed", "", 0, ""
    try:
        if case.kind == "refusal":
            status, reason = refused(case)
            value = 1.0 if status == "ok" else 0.0
        else:
            verdict = _guarded().call(judged, case, seconds=DEADLINE)
            value, status, reason = verdict.value, verdict.status, verdict.reason
            iterations, terms = verdict.iterations, verdict.terms
    except Broken as error:
        reason = str(error)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
    if case.kind == "map":
        value = float(iterations)
    unit, expected, tolerance = UNITS[case.kind]
    return Row(
        suite="extremes",
        scene=case.scene or case.name,
        method=METHOD,
        seed=0,
        metric=case.metric,
        unit=unit,
        value=value,
        status=status,
        reason=reason,
        expected=expected,
        tolerance=tolerance,
        terms=terms,
    )


UNITS: dict[str, tuple[str, float | None, float | None]] = {
    "outcome": ("vertex weights", 0.0, TOLERANCE),
    "map": ("iterations", None, None),
    "refusal": ("1", 1.0, 0.0),
}


def refused(case: Case) -> tuple[str, str]:
    """Status and reason: whether the input is refused with a message that names what is wrong."""
    naming = case.options["naming"]
    try:
        _function(case)()
    except ValueError as error:
        message = " ".join(str(error).split())
        if naming in message:
            return "ok", message
        return "failed", f"refused without naming '{naming}': {message}"
    return "failed", "was not refused"


def judged(case: Case) -> Verdict:
    """The hard step of a case, minimised and judged."""
    from ..checks.verdict import as_simulated, attempt

    return attempt(_function(case)(**case.options), as_simulated)


def _function(case: Case) -> Any:
    module, _, name = case.function.partition(":")
    return getattr(importlib.import_module(f"benchmarks.checks.{module}"), name)


@lru_cache(maxsize=1)
def _guarded() -> Guarded:
    """The one worker of this process, its kernels compiled."""
    guarded = Guarded()
    atexit.register(guarded.close)
    guarded.call(_warm_up, seconds=COMPILING)
    return guarded


def _warm_up() -> None:
    from ..checks.verdict import warm_up

    warm_up()
