"""Laws that an engine keeps whatever its energy, how far it is from its own limit, and what that costs.

A violation is a result, not a failure: its row is ok and outside its tolerance. Each row names version
and licence of the engine; one that is not installed is skipped.

Free fall. A step that adds g h to the velocity and moves by the new velocity, as backward Euler and
semi-implicit Euler do, has fallen g h^2 N (N + 1) / 2 after N steps; the continuous law is g t^2 / 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, wraps
from typing import Any

import numpy as np

from benchmarks import Measurement, known_answer
from engine_runs import FRAME, SPEED, Engine, EngineDiverged, RollOut, Step, roll_out, specimen
from engines import ENGINES, REFERENCE
from reference_sim import GRAVITY, Potential, minimise
from reference_sim.energies import Gravity, Inertia
from reference_sim.energies import Step as FrozenStep

GAP_FRAMES = (9, 19, 29)  # whose last time steps are compared with their own minimum
CONVERGED = 1.0  # [%] from its own limit
STILL = 0.25  # [%] between two budgets: nothing moves any more
REFERENCE_ITERATIONS = (1, 2, 4, 8)  # per time step, of the reference stopped early
REFERENCE_SUBSTEPS = (1, 4, 16, 64, 256)  # per frame
DEADLINE = 1800.0  # [s] of an answer: the first of an engine makes the roll-outs that others share


def centre(run: RollOut) -> np.ndarray:
    """Return the centre of mass (T, 3) [m] of each frame."""
    masses = run.specimen.cloth.masses
    return np.einsum("v,tvc->tc", masses, run.positions) / masses.sum()


def fall_over_discrete_law(run: RollOut) -> float:
    """Return the fall of a free sheet over g h^2 N (N + 1) / 2, h the engine's time step."""
    steps = round((len(run.positions) - 1) * FRAME / run.step)
    return _fall(run) / (0.5 * GRAVITY * run.step**2 * steps * (steps + 1))


def fall_over_continuous_law(run: RollOut) -> float:
    """Return the fall of a free sheet over g t^2 / 2."""
    return _fall(run) / (0.5 * GRAVITY * ((len(run.positions) - 1) * FRAME) ** 2)


def _fall(run: RollOut) -> float:
    heights = centre(run)[:, 1]
    return float(heights[0] - heights[-1])


def momentum_error(run: RollOut) -> float:
    """Return how far the centre of a thrown sheet is from its horizontal path, over that path [%]."""
    way = np.delete(centre(run)[-1] - centre(run)[0], 1)
    path = np.array([SPEED * (len(run.positions) - 1) * FRAME, 0.0])
    return 100.0 * float(np.linalg.norm(way - path) / np.linalg.norm(path))


def spin_kept(run: RollOut) -> float:
    """Return the share of the angular momentum about the vertical that is left at the end [%]."""
    start = _spin(run, run.positions[0], run.specimen.velocity)
    return 100.0 * _spin(run, run.positions[-1], run.velocity) / start


def _spin(run: RollOut, x: np.ndarray, v: np.ndarray) -> float:
    m = run.specimen.cloth.masses
    arm, speed = (a - (m @ a) / m.sum() for a in (x, v))
    return float(m @ np.cross(arm, speed)[:, 1])


def asymmetry(run: RollOut) -> float:
    """Return the largest distance between a vertex and the mirror image of its counterpart [%].

    It is taken over all frames, and over the root mean square of the motion.
    """
    image = run.positions[:, run.specimen.mirrored] * [-1.0, 1.0, 1.0]
    worst = np.linalg.norm(run.positions - image, axis=2).max()
    return 100.0 * float(worst / motion(run))


def motion(run: RollOut) -> float:
    """Return the root mean square [m] of the way of all vertices from their start, over all frames."""
    return _rms(run.positions[1:] - run.positions[0])


def distance(run: RollOut, limit: RollOut) -> float:
    """Return the root mean square distance of two roll-outs over the motion of the second [%]."""
    return 100.0 * _rms(run.positions[1:] - limit.positions[1:]) / motion(limit)


def _rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.square(difference).sum(axis=2).mean()))


def reaction_over_weight(run: RollOut) -> float:
    """Return the force of the pins over weight and inertia, m (g + a), in the last second.

    The force is the gradient of the engine's documented energies at the pins, the pinned mass added, and
    a is the acceleration of the centre. Both are taken from the same time steps, the last of each frame,
    because the law is exact in every time step. Forces at the ends of frames over an acceleration from
    the centres of frames would be wrong by 1 or 2 % where the strip bounces: 30 samples a second do not
    average its force.

    Without energies the force is not known, and the number is 1 + a / g, with the a between the ends of
    the last second; it is 1 at rest.
    """
    cloth, energies = run.specimen.cloth, run.cloth.energies
    first = len(run.positions) // 3 * 2
    if not energies:
        speeds = np.diff(centre(run)[first - 1 :, 1]) / FRAME
        return 1.0 + float(speeds[-1] - speeds[0]) / (FRAME * (len(speeds) - 1)) / GRAVITY
    pulls, inertias = [], []
    for step in run.last_steps[first:]:
        x = step.x if run.cloth.explicit else step.after
        pulls.append(sum(energy.value_and_gradient(x)[1][cloth.pins, 1].sum() for energy in energies))
        acceleration = (step.after - step.x - run.step * step.v)[:, 1] / run.step**2
        inertias.append(cloth.masses @ (GRAVITY + acceleration))
    pinned = GRAVITY * cloth.masses[cloth.pins].sum()
    return float((np.mean(pulls) + pinned) / np.mean(inertias))


def energy_gap(run: RollOut) -> float | None:
    """Return what the engine leaves of the decrease of its own incremental potential, in some steps [%].

    0 is the minimum, found by Newton's method from the same state; 100 is the inertial guess x + h v.
    None where energies are not documented.

    Raises:
        RuntimeError: Newton's method did not converge in one of these steps.
    """
    if not run.cloth.energies:
        return None
    return float(np.mean([_gap(run.last_steps[frame], run) for frame in GAP_FRAMES]))


def _gap(step: Step, run: RollOut) -> float:
    cloth = run.specimen.cloth
    potential = Potential([*run.cloth.energies, Gravity(cloth), Inertia(cloth, run.step)])
    guess = step.x + run.step * step.v
    guess[cloth.pins] = step.x[cloth.pins]
    potential.prepare(FrozenStep(step.x, step.v, guess, run.step))
    minimum = minimise(potential, guess, max_iterations=200)
    if minimum.status != "converged":
        raise RuntimeError(
            f"energy gap: the minimum of a step is not known: {minimum.status}, {minimum.reason}"
        )
    floor = minimum.energy
    return 100.0 * (potential.value(step.after) - floor) / (potential.value(guess) - floor)


Answer = tuple[float | None, str]  # value and remark


def measured(measure: Callable[..., Answer]) -> Callable[..., Measurement]:
    """Let a measurement be called with the name of an engine, whose version then stands beside the answer.

    An absent engine is skipped, one that diverges says so.
    """

    @wraps(measure)
    def measurement(engine: str, **options: Any) -> Measurement:
        declared = ENGINES[engine]
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
    """Return the number of a law by the engine's default roll-out of a specimen."""
    value = LAWS[name][0](cached_roll_out(engine.name, sample))
    return value, "" if value is not None else "its energy is not documented"


@measured
def budgeted(engine: Engine, factor: int, what: str) -> Answer:
    """Return a budget's distance from the engine's own limit [%], or the time of a frame [ms]."""
    runs, limit_not_reached = ladder(engine.name)
    if factor not in runs and factor < max(runs):
        raise EngineDiverged("at this budget")
    if factor not in runs:
        return None, f"nothing moved any more at {max(runs)} times the default"
    if what == "time":
        return runs[factor].milliseconds, ""
    return None if limit_not_reached else distance(runs[factor], runs[max(runs)]), limit_not_reached


@measured
def converged_budget(engine: Engine) -> Answer:
    """Return the least multiple of the default budget that is within CONVERGED of the engine's limit."""
    runs, limit_not_reached = ladder(engine.name)
    factor = None if limit_not_reached else _within(runs)
    return factor, limit_not_reached or ("" if factor else f"no budget is within {CONVERGED:g} %")


@measured
def last_move(engine: Engine) -> Answer:
    """Return how far the last fourfold budget still moved the hanging sheet [%]."""
    runs, remark = ladder(engine.name)
    *_, before, last = sorted(runs)
    return distance(runs[before], runs[last]), remark


@measured
def reference_milliseconds(engine: Engine) -> Answer:
    """Return the time of a frame by the reference, where it is as near its own limit as CONVERGED [ms].

    Of an engine that iterates more: the reference takes the engine's time step, and fewer iterations of
    Newton's method. Of one that takes smaller steps: the reference takes smaller steps.
    """
    runs = reference_ladder(engine.substeps if engine.iterates else None)
    count, of_budget = _within(runs), "iterations a step" if engine.iterates else "steps a frame"
    if count is None:
        return None, f"the reference is not within {CONVERGED:g} % at {sorted(runs)[-2]} {of_budget}"
    return runs[count].milliseconds, f"{count} {of_budget}"


@cache
def cached_roll_out(engine: str, sample: str, factor: int = 1) -> RollOut:
    """Return the roll-out of a declared engine on a declared specimen, done once in this process."""
    return roll_out(ENGINES[engine], specimen(sample), factor)


@cache
def ladder(engine: str) -> tuple[dict[int, RollOut], str]:
    """Return factor -> roll-out of the hanging sheet, until a fourfold budget moves nothing, and a remark.

    Budgets that diverge are left out. Raises EngineDiverged where fewer than two are left.
    """
    runs: dict[int, RollOut] = {}
    for factor in ENGINES[engine].factors:
        try:
            run = cached_roll_out(engine, "hanging", factor)
        except EngineDiverged:
            continue
        move = distance(runs[max(runs)], run) if runs else 100.0
        runs[factor] = run
        if move <= STILL:
            return runs, ""
    if len(runs) < 2:
        raise EngineDiverged("it diverges at all budgets but one or none")
    return runs, f"its last two budgets differ by {move:.2g} %, so its limit is not reached"


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


def _within(runs: dict[int, RollOut]) -> int | None:
    """Return the least budget from which on all are within CONVERGED of the largest; None but for it."""
    result = None
    for budget in sorted(runs, reverse=True)[1:]:
        if distance(runs[budget], runs[max(runs)]) > CONVERGED:
            break
        result = budget
    return result


# law -> function, specimen, unit, expected value, tolerance
LAWS: dict[str, tuple[Callable[[RollOut], float | None], str, str, float | None, float | None]] = {
    "fall_over_discrete_law": (fall_over_discrete_law, "falling", "1", 1.0, 0.01),
    "fall_over_continuous_law": (fall_over_continuous_law, "falling", "1", None, None),
    "momentum_error": (momentum_error, "thrown", "%", 0.0, 1.0),
    "spin_kept": (spin_kept, "thrown", "%", None, None),
    "asymmetry": (asymmetry, "hanging", "%", 0.0, 1.0),
    "reaction_over_weight": (reaction_over_weight, "strip", "1", 1.0, 0.01),
    "energy_gap": (energy_gap, "hanging", "%", 0.0, 1.0),
}


def declare(engine: Engine) -> None:
    """Declare the known answers of an engine, which share a process."""

    def answer(function: Any, name: str, metric: str, place: str = "", **fields: Any) -> None:
        options = {"engine": engine.name, **fields.pop("options", {})}
        known_answer(
            {f"{engine.name}.{name}": options}, scene=engine.name + place, metric=f"engine/{metric}",
            method=engine.name, seconds=DEADLINE, process=f"engine-{engine.name}", **fields,
        )(function)  # fmt: skip

    for name, (_, sample, unit, expected, tolerance) in LAWS.items():
        options = {"name": name, "sample": sample}
        answer(law, name, name, options=options, unit=unit, expected=expected, tolerance=tolerance)
    for factor in engine.factors:
        place, budget = f"/x{factor}", {"factor": factor}
        answer(budgeted, f"x{factor}.distance", "distance", place, options=budget | {"what": "distance"},
               unit="%", expected=0.0, tolerance=1.0)  # fmt: skip
        answer(budgeted, f"x{factor}.time", "time", place, options=budget | {"what": "time"}, unit="ms")
    answer(last_move, "last_move", "last_move", unit="%")
    answer(converged_budget, "budget", "budget")
    answer(reference_milliseconds, "reference_time", "reference_time", unit="ms")


for engine in ENGINES.values():
    declare(engine)
