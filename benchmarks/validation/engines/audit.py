"""Measurements of one engine. Each row names version and licence; an absent engine is skipped."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache

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


def law(engine: str, name: str, sample: str) -> Measurement:
    """Evaluate a function of benchmarks.engines.laws on the engine's default roll-out of a specimen."""

    def measure(found: Engine) -> Answer:
        value: float | None = getattr(laws, name)(cached_roll_out(engine, sample))
        return value, "" if value is not None else "it does not tell velocities, or its energy"

    return measurement(engine, measure)


def distance(engine: str, factor: int) -> Measurement:
    """Return the distance of a budget's roll-out from the engine's own limit [%]."""
    return _of_budget(
        engine, factor, lambda runs, remark: (laws.distance(runs[factor], runs[max(runs)]), remark)
    )


def milliseconds(engine: str, factor: int) -> Measurement:
    """Return the processor time of a frame of the hanging sheet at that budget [ms]."""
    return _of_budget(engine, factor, lambda runs, _: (runs[factor].milliseconds, ""))


def _of_budget(engine: str, factor: int, number: Callable[[dict[int, RollOut], str], Answer]) -> Measurement:
    """Evaluate a number of the engine's ladder and its remark, where the ladder has that budget."""

    def measure(found: Engine) -> Answer:
        runs, remark = ladder(engine)
        if factor not in runs:
            return None, f"nothing moved any more at {max(runs)} times the default"
        return number(runs, remark)

    return measurement(engine, measure)


def converged_budget(engine: str) -> Measurement:
    """Return the least multiple of the default budget that is within CONVERGED of the engine's limit."""

    def measure(found: Engine) -> Answer:
        runs, remark = ladder(engine)
        factor = _within(runs, CONVERGED)
        return factor, remark if factor is not None else f"no budget is within {CONVERGED:g} %{remark}"

    return measurement(engine, measure)


def last_move(engine: str) -> Measurement:
    """Return how far the last fourfold budget still moved the hanging sheet [%]."""

    def measure(found: Engine) -> Answer:
        runs, remark = ladder(engine)
        *_, before, last = sorted(runs)
        return laws.distance(runs[before], runs[last]), remark

    return measurement(engine, measure)


def reference_milliseconds(engine: str) -> Measurement:
    """Return the time of a frame by the reference, where it is as near its own limit as CONVERGED [ms].

    Of an engine that iterates more: the reference takes the engine's time step, and fewer iterations of
    Newton's method. Of one that takes smaller steps: the reference takes smaller steps.
    """

    def measure(found: Engine) -> Answer:
        runs = reference_ladder(found)
        count = _within(runs, CONVERGED)
        if count is None:
            return None, f"the reference is not within {CONVERGED:g} % at {sorted(runs)[-2]} steps a frame"
        what = "iterations a step" if found.grows == ITERATIONS else "steps a frame"
        return runs[count].milliseconds, f"{count} {what}"

    return measurement(engine, measure)


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


def reference_ladder(engine: Engine) -> dict[int, RollOut]:
    """Return iterations or sub-steps -> roll-out of the hanging sheet by the reference."""
    if engine.grows == ITERATIONS:
        return _reference_iterations(engine.substeps)
    return _reference_substeps()


@cache
def _reference_iterations(substeps: int) -> dict[int, RollOut]:
    runs: dict[int, RollOut] = {}
    for count in (*REFERENCE_ITERATIONS, REFERENCE.iterations):
        runs[count] = _reference(substeps, count)
    return runs


@cache
def _reference_substeps() -> dict[int, RollOut]:
    return {count: _reference(count, REFERENCE.iterations) for count in REFERENCE_SUBSTEPS}


def _reference(substeps: int, iterations: int) -> RollOut:
    engine = dataclasses.replace(REFERENCE, substeps=substeps, iterations=iterations)
    return roll_out(engine, specimen("hanging"))


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


def measurement(engine: str, measure: Callable[[Engine], Answer]) -> Measurement:
    """Measure, or say why not: an absent engine is skipped, one that diverges says so."""
    found = find_engine(engine)
    if found.absent:
        return Measurement(value=None, status="skipped", reason=found.absent)
    try:
        value, remark = measure(found)
    except EngineDiverged as error:
        return Measurement(value=None, status="diverged", reason=f"{found.version}; {error}")
    reason = "; ".join(filter(None, [found.version, found.settings, remark]))
    return Measurement(value=value, status="skipped" if value is None else "ok", reason=reason)
