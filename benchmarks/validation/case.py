"""Case: one row whose answer is known before anything is computed, or whose failure has to be reported."""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from benchmarks.results.row import Row

METHOD = "simulation"
RELATIVE_RESIDUAL = 1e-6  # of a stress step: largest gradient component over the mean weight of a vertex


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """Row of a case that says by itself how it ended: value, status, reason and terms."""

    value: float | None
    status: str
    reason: str
    terms: str = ""


@dataclass(frozen=True, kw_only=True)
class Case:
    """Declaration of one row: function, expected value and tolerance. `reason` defends the tolerance.

    `function` of `module`, called with `options`, returns a number, (measured, expected) where the reference
    has to be solved first, or a Measurement. A number without a tolerance is reported, not judged.

    Attributes:
        name: unique over all cases, and the row's scene unless `scene` is given.
        module: dotted; with all that it imports it is what the row depends on.
        smoke: whether the smallest preset runs it.
        long: whether it is left out where no suite is named.
        seconds: after which the case's process is ended; None: never.
        map_point: (factor on the stiffness, time step [s]) of a point of a stability map, which its scene is.
        method: of its row.
        process: where it has a name, the case is timed: it runs alone on the machine, in the process of this
            name, after others of this name.
    """

    name: str
    suite: str = "validation"
    description: str
    module: str
    function: str
    options: dict[str, Any] = field(default_factory=dict, hash=False)
    scene: str = ""
    metric: str = "check"
    unit: str = "1"
    expected: float | None = None
    tolerance: float | None = None
    reason: str = ""
    smoke: bool = False
    long: bool = False
    seconds: float | None = None
    map_point: tuple[float, float] | None = None
    method: str = METHOD
    process: str = ""

    def run(self) -> Row:
        """Measure here and now and return the row. What is raised becomes a failed row with its reason."""
        try:
            with slow_paths_allowed():
                measured = self._imported(self.function)(**self.options)
            if isinstance(measured, Measurement):
                return self.row(measured.value, measured.status, measured.reason, terms=measured.terms)
            value, expected = measured if isinstance(measured, tuple) else (measured, self.expected)
            return self.judged(float(value), None if expected is None else float(expected))
        except Exception as error:
            return self.row(reason=f"{type(error).__name__}: {error}")

    def warm_up(self) -> None:
        """Compile what the first case of a process would otherwise compile within its deadline."""
        with slow_paths_allowed():
            self._imported("warm_up", lambda: None)()

    def judged(self, value: float, expected: float | None) -> Row:
        """Return the row of a number: ok where it is finite and within the tolerance of the expected one."""
        if not math.isfinite(value):
            return self.row(reason=f"the measured number is {value}", expected=expected)
        if self.tolerance is None:
            return self.row(value, "ok", expected=expected)
        if expected is None:
            return self.row(value, reason="a tolerance, but nothing to compare with")
        if abs(value - expected) <= self.tolerance:
            return self.row(value, "ok", expected=expected)
        far = f"{value:.6g} is further than {self.tolerance:g} from {expected:g} ({self.reason})"
        return self.row(value, reason=far, expected=expected)

    def row(
        self,
        value: float | None = None,
        status: str = "failed",
        reason: str = "",
        *,
        expected: float | None = None,
        terms: str = "",
    ) -> Row:
        """Return the row with these values; it expects what the case declares unless another is given."""
        return Row(
            suite=self.suite,
            scene=self.scene or self.name,
            method=self.method,
            seed=0,
            metric=self.metric,
            unit=self.unit,
            value=value,
            status=status,
            reason=reason,
            expected=self.expected if expected is None else expected,
            tolerance=self.tolerance,
            terms=terms,
        )

    def _imported(self, *name_and_default: Any) -> Any:
        return getattr(importlib.import_module(self.module), *name_and_default)


@contextmanager
def slow_paths_allowed() -> Iterator[None]:
    """Say nothing of terms without a fast kernel: a case is not timed."""
    from reference_sim.kernels.fast_kernels import SlowPathWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SlowPathWarning)
        yield


def known_answer(
    name: str, description: str, module: str, function: str, *, smoke: bool = True, **declared: Any
) -> Case:
    """Return a case of suite validation, measured by `function` of benchmarks.validation.<module>.

    >>> known_answer("one", "a number", "membrane.closed_forms", "zero_modes", expected=6.0).suite
    'validation'
    """
    module = f"benchmarks.validation.{module}"
    return Case(name=name, description=description, module=module, function=function, smoke=smoke, **declared)
