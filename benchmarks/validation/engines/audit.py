"""Measurements of one engine. Each row names version and licence; an absent engine is skipped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, wraps
from typing import Any

from benchmarks.engines import laws
from benchmarks.engines.engine import ITERATIONS, Engine
from benchmarks.engines.registry import REFERENCE, find_engine
from benchmarks.engines.roll_outs import EngineDiverged, RollOut, cached_roll_out, roll_out
from benchmarks.engines.specimens import specimen
from benchmarks.validation.case import Measurement

CONVERGED = 1.0  # [%] from its own limit
STILL = 0.25  # [%] between two budgets: nothing moves any more
REFERENCE_ITERATIONS = (1, 2, 4, 8)  # per time step, of the reference stopped early
REFERENCE_SUBSTEPS = (1, 4, 16, 64, 256)  # per frame

Answer = tuple[float | None, str]  # value and remark


def measured(measure: Callable[..., Answer]) -> Callable[..., Measurement]:
    """Let a measurement be called with the name of an engine, whose version then stands beside the answer.

    An absent engine is skipped, one that diverges says so.
    """

    @wraps(measure)
    def measurement(engine: str, **options: Any) -> Measurement:
        declared = find_engine(engine)
        if declared.absent:
            return Measurement(value=None, status="skipped", reason=declared.absent)
        try:
            value, remark = measure(declared, **options)
        except EngineDiverged as error:
            return Measurement(value=None, status="diverged", reason=f"{declared.version}; {error}")
        reason = "; ".join(filter(None, [declared.version, declared.settings, remark]))
        return Measurement(value=value, status="skipped" if value is None else "ok", reason=reason)

    return measurement


@measured
def law(engine: Engine, name: str, sample: str) -> Answer:
    """Evaluate a function of benchmarks.engines.laws on the engine's default roll-out of a specimen."""
    value: float | None = getattr(laws, name)(cached_roll_out(engine.name, sample))
    return value, "" if value is not None else "its energy is not documented"


@measured
def distance(engine: Engine, factor: int) -> Answer:
    """Return the distance of a budget's roll-out from the engine's own limit [%]."""
    runs, remark = ladder(engine.name)
    if factor not in runs:
        return None, _left_out(runs)
    return laws.distance(runs[factor], runs[max(runs)]), remark


@measured
def milliseconds(engine: Engine, factor: int) -> Answer:
    """Return the processor time of a frame of the hanging sheet at that budget [ms]."""
    runs, _ = ladder(engine.name)
    return (runs[factor].milliseconds, "") if factor in runs else (None, _left_out(runs))


def _left_out(runs: dict[int, RollOut]) -> str:
    return f"nothing moved any more at {max(runs)} times the default"


@measured
def converged_budget(engine: Engine) -> Answer:
    """Return the least multiple of the default budget that is within CONVERGED of the engine's limit."""
    runs, remark = ladder(engine.name)
    factor = _within(runs, CONVERGED)
    if factor is not None:
        return factor, remark
    return None, "; ".join(filter(None, (f"no budget is within {CONVERGED:g} %", remark)))


@measured
def last_move(engine: Engine) -> Answer:
    """Return how far the last fourfold budget still moved the hanging sheet [%]."""
    runs, remark = ladder(engine.name)
    *_, before, last = sorted(runs)
    return laws.distance(runs[before], runs[last]), remark


@measured
def reference_milliseconds(engine: Engine) -> Answer:
    """Return the time of a frame by the reference, where it is as near its own limit as CONVERGED [ms].

    Of an engine that iterates more: the reference takes the engine's time step, and fewer iterations of
    Newton's method. Of one that takes smaller steps: the reference takes smaller steps.
    """
    iterates = engine.grows == ITERATIONS
    runs = reference_ladder(engine.substeps if iterates else None)
    count, of_budget = _within(runs, CONVERGED), "iterations a step" if iterates else "steps a frame"
    if count is None:
        return None, f"the reference is not within {CONVERGED:g} % at {sorted(runs)[-2]} {of_budget}"
    return runs[count].milliseconds, f"{count} {of_budget}"


@cache
def ladder(engine: str) -> tuple[dict[int, RollOut], str]:
    """Return factor -> roll-out of the hanging sheet, until a fourfold budget moves nothing, and a remark.

    Budgets that diverge are left out. Raises EngineDiverged where fewer than two are left.
    """
    runs: dict[int, RollOut] = {}
    for factor in find_engine(engine).factors:
        try:
            run = cached_roll_out(engine, "hanging", factor)
        except EngineDiverged:
            continue
        moved = laws.distance(runs[max(runs)], run) if runs else 100.0
        runs[factor] = run
        if moved <= STILL:
            return runs, ""
    if len(runs) < 2:
        raise EngineDiverged("it diverges at all budgets but one or none")
    return runs, f"its last two budgets differ by {moved:.2g} %, so its limit is not reached"


@cache
def reference_ladder(substeps: int | None) -> dict[int, RollOut]:
    """Return budget -> roll-out of the hanging sheet by the reference.

    The budget is iterations of steps of which `substeps` make a frame; where it is None, sub-steps.
    """
    if substeps is None:
        budgets = {count: (count, REFERENCE.iterations) for count in REFERENCE_SUBSTEPS}
    else:
        budgets = {count: (substeps, count) for count in (*REFERENCE_ITERATIONS, REFERENCE.iterations)}
    return {
        count: roll_out(replace(REFERENCE, substeps=steps, iterations=iterations), specimen("hanging"))
        for count, (steps, iterations) in budgets.items()
    }


def _within(runs: dict[int, RollOut], percent: float) -> int | None:
    """Return the least budget from which on all are within that distance of the largest; it must not be it.

    None where only the largest is.
    """
    limit = runs[max(runs)]
    least = None
    for budget in sorted(runs, reverse=True)[1:]:
        if laws.distance(runs[budget], limit) > percent:
            break
        least = budget
    return least
