"""Cases of suite engines. A violation is a result, not a failure: its row is ok and outside its tolerance."""

from __future__ import annotations

from typing import Any

from benchmarks.engines.engine import Engine
from benchmarks.engines.registry import ENGINES
from benchmarks.validation.case import Case

MODULE = "benchmarks.validation.engines.audit"
SUITE = "engines"
DEADLINE = 1800.0  # [s] of a case: the first of an engine makes the roll-outs that others share
SMOKE = ("reference", "mujoco.euler")  # at the smallest preset

# law -> specimen, unit, expected value, tolerance, description
LAWS: dict[str, tuple[str, str, float | None, float | None, str]] = {
    "fall_over_discrete_law": (
        "falling", "1", 1.0, 0.01, "fall of a free sheet over g h^2 N (N + 1) / 2, h the engine's step"),
    "fall_over_continuous_law": ("falling", "1", None, None, "fall of a free sheet over g t^2 / 2"),
    "momentum_error": (
        "thrown", "%", 0.0, 1.0, "distance of a thrown, spinning sheet's centre from its horizontal path"),
    "spin_kept": ("thrown", "%", None, None, "angular momentum of the thrown sheet left after 1 s"),
    "asymmetry": (
        "hanging", "%", 0.0, 1.0, "largest distance from the mirror image, over the motion's mean square"),
    "reaction_over_weight": (
        "strip", "1", 1.0, 0.01, "force of the pins of a hanging strip over m (g + a), third second"),
    "energy_gap": (
        "hanging", "%", 0.0, 1.0, "decrease of its own incremental potential that a step leaves undone"),
}  # fmt: skip


def _cases(engine: Engine) -> tuple[Case, ...]:
    def case(
        name: str, metric: str, function: str, description: str, *, scene: str = "", unit: str = "1",
        **declared: Any,
    ) -> Case:  # fmt: skip
        options = {"engine": engine.name} | declared.pop("options", {})
        return Case(
            name=f"{engine.name}.{name}", suite=SUITE, description=f"{engine.title}: {description}",
            module=MODULE, function=function, options=options, scene=scene or engine.name,
            metric=f"engine/{metric}", unit=unit, smoke=engine.name in SMOKE, seconds=DEADLINE,
            method=engine.name, process=f"engine-{engine.name}", **declared,
        )  # fmt: skip

    laws = [
        case(name, name, "law", text, unit=unit, expected=expected, tolerance=tolerance,
            options={"name": name, "sample": sample})
        for name, (sample, unit, expected, tolerance, text) in LAWS.items()
    ]  # fmt: skip
    budgets = [
        made
        for factor in engine.factors
        for made in (
            case(f"x{factor}.distance", "distance", "distance", scene=f"{engine.name}/x{factor}", unit="%",
                description=f"distance of the hanging sheet from its own limit, {factor} times the default",
                expected=0.0, tolerance=1.0, options={"factor": factor}),
            case(f"x{factor}.time", "time", "milliseconds", scene=f"{engine.name}/x{factor}", unit="ms",
                description=f"processor time of a frame, {factor} times the default budget",
                options={"factor": factor}),
        )
    ]  # fmt: skip
    return (
        *laws,
        *budgets,
        case("last_move", "last_move", "last_move", "move by its last fourfold budget", unit="%"),
        case("budget", "budget", "converged_budget", "least multiple within 1 % of its own limit"),
        case("reference_time", "reference_time", "reference_milliseconds",
            "time of a frame by the reference within 1 % of its own limit", unit="ms"),
    )  # fmt: skip


CASES: tuple[Case, ...] = tuple(case for engine in ENGINES for case in _cases(engine))
