"""Case: one row whose answer is known before anything is computed, or whose failure has to be reported.

A module of cases is imported to list them: it loads what is slow inside its functions.
"""

from __future__ import annotations

import importlib
import inspect
import math
import warnings
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from benchmarks.declarations import load
from benchmarks.results.row import Row

METHOD = "simulation"
Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """Row of a case that says how it ended: value, status, reason, terms, what it expected."""

    value: float | None = None
    status: str = "failed"
    reason: str = ""
    terms: str = ""
    expected: float | None = None


@dataclass(frozen=True, kw_only=True)
class Case:
    """Declaration of one row: function, expected value and tolerance. `reason` defends the tolerance.

    `function` of `module`, called with `options`, returns a number, (measured, expected) where the
    reference has to be solved first, a Measurement, or any of these by name of the case. A number without
    a tolerance is reported, not judged.

    Attributes:
        name: unique over all cases, and the row's scene unless `scene` is given.
        module: dotted, or a path that ends with .py.
        smoke: whether `{smoke}` of a study means it.
        long: whether `{short}` of a study leaves it out.
        seconds: after which the case's process is ended; None: never.
        method: of its row.
        process: where it has a name, the case is timed: it runs alone on the machine, in the process of
            this name, after others of this name.
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
    method: str = METHOD
    process: str = ""

    def run(self) -> Row:
        """Measure here and now and return the row. What is raised becomes a failed row with its reason."""
        try:
            from reference_sim.kernels.fast_kernels import SlowPathWarning

            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SlowPathWarning)  # a case is not timed
                answer = getattr(load(self.module), self.function)(**self.options)
            if isinstance(answer, Mapping):
                answer = answer[self.name]
            if not isinstance(answer, Measurement):
                value, expected = answer if isinstance(answer, tuple) else (answer, self.expected)
                answer = self.judge(float(value), None if expected is None else float(expected))
        except Exception as error:
            answer = Measurement(reason=f"{type(error).__name__}: {error}")
        return Row(
            self.suite, self.scene or self.name, self.method, 0, self.metric, self.unit,
            value=answer.value, status=answer.status, reason=answer.reason, terms=answer.terms,
            expected=self.expected if answer.expected is None else answer.expected,
            tolerance=self.tolerance,
        )  # fmt: skip

    def warm_up(self) -> None:
        """Compile what the first case of a process would otherwise compile within its deadline."""
        getattr(load(self.module), "warm_up", lambda: None)()

    def judge(self, value: float, expected: float | None) -> Measurement:
        """Judge a number: it is ok where it is finite and within the tolerance of the expected one."""
        if not math.isfinite(value):
            return Measurement(reason=f"the measured number is {value}", expected=expected)
        reason = ""
        if self.tolerance is None:
            pass  # reported, not judged
        elif expected is None:
            reason = "a tolerance, but nothing to compare with"
        elif abs(value - expected) > self.tolerance:
            reason = f"{value:.6g} is further than {self.tolerance:g} from {expected:g} ({self.reason})"
        return Measurement(
            value=value, status="failed" if reason else "ok", reason=reason, expected=expected
        )


_declared: dict[str, list[Case]] = defaultdict(list)  # by module


def known_answer(
    cases: str | Sequence[str] | Mapping[str, Mapping[str, Any]] = (),
    /,
    *,
    smoke: bool = True,
    **declared: Any,
) -> Callable[[Function], Function]:
    """Declare a function as one or more cases: their names, or name -> options of the function.

    Without names the case has the function's; for several cases at once it returns name -> number. What
    its docstring says that it returns describes the case unless `description` does. declared: further
    fields of Case.

    >>> @known_answer({"sum of two": {"count": 2}, "sum of three": {"count": 3}}, unit="1", tolerance=1e-12)
    ... def sums_of_odd_numbers(count):
    ...     '''Return the sum of the first odd numbers, and the square of their count.'''
    ...     return sum(range(1, 2 * count, 2)), count**2
    >>> [case.name for case in cases_of(sums_of_odd_numbers.__module__)]
    ['sum of two', 'sum of three']
    """

    def declare(function: Function) -> Function:
        sentence = (inspect.getdoc(function) or "").partition("\n\n")[0].removeprefix("Return the ")
        names = (cases,) if isinstance(cases, str) else cases
        named = names if isinstance(names, Mapping) else {name: {} for name in names}
        for name, options in (named or {function.__name__: {}}).items():
            values = ", ".join(f"{option} = {value}" for option, value in options.items())
            description = f"{sentence.rstrip('.')}: {values}".removesuffix(": ")
            case = Case(
                name=name, module=function.__module__, function=function.__name__, options=dict(options),
                smoke=smoke, **{"description": description, **declared},
            )  # fmt: skip
            _declared[function.__module__].append(case)
        return function

    return declare


def cases_of(module: str) -> tuple[Case, ...]:
    """Import a module and return the cases that its functions declare."""
    importlib.import_module(module)
    return tuple(_declared[module])
