"""Check of a module of metrics: whether it keeps the contract of benchmarks.metric, on two roll-outs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real
from types import ModuleType
from typing import TYPE_CHECKING

from benchmarks.cell import TaskId
from benchmarks.contract.findings import Findings
from benchmarks.declarations import load
from benchmarks.methods.catalogue.all_methods import find_method
from benchmarks.results.row import STATUSES
from benchmarks.scene import Scene
from benchmarks.tasks.task import Context, Outcome, Task

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

PERTURBATION = 1e-3  # [m] by which the second roll-out is off


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckMetrics(Task):
    """Measure the simulation and the same moved by a little; the findings are in the result."""

    kind = "check"
    stage = "check"
    home: str
    scene: Scene

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Check, and return the findings as the result."""
        findings = Findings(self.home)
        return findings.look(lambda: self._check(findings, context))

    def _check(self, findings: Findings, context: Context) -> None:
        import numpy as np

        from benchmarks.metric import RollOut, SceneRollOuts

        entry, scene = find_method("simulation"), self.scene.build(context.assets)
        simulation = entry.make(models=context.folder.models, seed=0)
        simulation.prepare(scene)
        first = simulation.run()
        random = np.random.default_rng(0)
        moved = first.positions + PERTURBATION * random.standard_normal(first.positions.shape)
        group = SceneRollOuts(scene)
        other = replace(entry, name="moved", role="solver")
        group.roll_outs += [
            RollOut(group, entry, first, suites=("speed",)),
            RollOut(group, other, replace(first, positions=moved), suites=("speed",)),
        ]
        module, names = load(self.home), set[str]()
        for roll_out in group.roll_outs:
            kept = roll_out.positions.copy()
            names |= self._measure(findings, module, roll_out)
            findings.demand(
                np.array_equal(roll_out.positions, kept),
                "alters the positions of a roll-out: copy what you change; other metrics read it too",
            )
        silent = [metric.name for metric in module.METRICS if not _declares(metric.name, names)]
        if silent:
            findings.notes.append(f"{self.scene.name} gives no {', '.join(silent)}")

    def _measure(self, findings: Findings, module: ModuleType, roll_out: RollOut) -> set[str]:
        """Measure a roll-out twice, and return the names of its values."""
        import numpy as np

        on = f"of {roll_out.entry.name}"
        with findings.call(f"measure() {on}", ": leave out of the dictionary what does not apply"):
            values, again = (module.measure(roll_out) for _ in range(2))
        if hasattr(module, "compare") and roll_out.reference is not None:
            with findings.call(f"compare() {on}"):
                compared = module.compare(roll_out, roll_out.reference)
                values, again = values | compared, again | module.compare(roll_out, roll_out.reference)
        for name, value in values.items():
            number = value[0] if isinstance(value, tuple) else value
            findings.demand(
                any(_declares(metric.name, {name}) for metric in module.METRICS),
                f"measures {name}, which METRICS does not declare",
            )
            fine = isinstance(number, Real) and not isinstance(number, bool)
            if not findings.demand(fine, f"{name} {on} is a {type(number).__name__}: give a float"):
                continue
            findings.demand(math.isfinite(number), f"{name} {on} is {number}: leave out what does not apply")
            findings.demand(
                again.get(name) == value, f"{name} {on} is {value}, then {again.get(name)}: fix its seed"
            )
        if hasattr(module, "series"):
            with findings.call(f"series() {on}"):
                curves = module.series(roll_out)
            shape = roll_out.positions.shape[:2]
            for name, curve in curves.items():
                findings.demand(
                    np.shape(curve) in (shape[:1], shape),
                    f"series() gives {name} {np.shape(curve)}: expected one number a frame "
                    f"{shape[:1]}, or one a frame and vertex {shape}",
                )
        if hasattr(module, "judge"):
            with findings.call(f"judge() {on}"):
                judgement = module.judge(roll_out, values)
            findings.demand(
                judgement is None
                or (isinstance(judgement, tuple) and len(judgement) == 2 and judgement[0] in STATUSES),
                f"judge() gives {judgement!r}: expected None, or a status ({', '.join(STATUSES)}) "
                "and a reason",
            )
        return set(values)


def _declares(metric: str, names: set[str]) -> bool:
    """Return whether one of the names is the metric, or fits its pattern "family/*"."""
    return any(name == metric or (metric.endswith("/*") and name.startswith(metric[:-1])) for name in names)
