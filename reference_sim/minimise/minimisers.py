"""Minimisers by name, and the minimisation of one time step.

A step of most potentials is one call of their minimiser, from the first guess. A term that joins late, as
a barrier, which nothing may pass, is left out until the cloth comes near itself, and approached along a
free way.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from reference_sim.minimise.descent import STATUSES, Result
from reference_sim.minimise.lbfgs import LBFGS
from reference_sim.minimise.newton import Newton
from reference_sim.potential import Potential


class Minimiser(Protocol):
    """Solver bound to one potential, so that symbolic analysis is done once for all steps."""

    def minimise(self, x0: np.ndarray) -> Result:
        """Minimise from x0 (V, 3) [m]; pinned vertices stay where x0 has them."""
        ...

    def start_again(self) -> None:
        """Let the next run give the bits of a first one: forget what was learned from step to step."""
        ...


MINIMISERS: dict[str, Callable[..., Minimiser]] = {"newton": Newton, "lbfgs": LBFGS}


def make_minimiser(
    potential: Potential, method: str | Callable[..., Minimiser] = "newton", **options: Any
) -> Minimiser:
    """Return a minimiser, for a caller that minimises the same potential again and again.

    method: a name in MINIMISERS, or a function of potential and options. Raises ValueError for other
    names.
    """
    if callable(method):
        return method(potential, **options)
    if method not in MINIMISERS:
        raise ValueError(f"unknown minimiser {method!r}: choose one of {', '.join(MINIMISERS)}")
    return MINIMISERS[method](potential, **options)


def minimise(potential: Potential, x0: np.ndarray, method: str = "newton", **options: Any) -> Result:
    """Minimise `potential` from x0 (V, 3) [m]; pinned vertices stay where x0 has them.

    method: "newton" or "lbfgs". options: of its class, `Newton` or `LBFGS`: tolerance, max_iterations,
    timeout, ...

    Raises ValueError for an unknown method, or a tolerance that is no number above 0.

    Example: a sheet of two triangles hangs from one side.

        >>> import numpy as np
        >>> from reference_sim import Cloth, Potential, minimise
        >>> from reference_sim.energies import Gravity, StretchStVK
        >>> x = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1], [0.1, 0.0, 0.1]])
        >>> cloth = Cloth(x, np.array([[0, 2, 1], [1, 2, 3]]), pins=[0, 1])
        >>> result = minimise(Potential([StretchStVK(cloth), Gravity(cloth)]), x - [0.0, 0.05, 0.0])
        >>> result.status, bool(result.gradient_norm < 1e-6)
        ('converged', True)
        >>> (result.positions[2:, 1] - result.positions[:2, 1]).round(3).tolist()
        [-0.1, -0.1]
    """
    return make_minimiser(potential, method, **options).minimise(x0)


MAX_APPROACHES = 100  # minimisations on the way of the pins within one step
LEAST_APPROACH = 2e-3  # of that way, by three of them together; less is no way
APPROACH_SHARE = 0.8  # of the way to the next touch: closer, a barrier grows stiff
# Minimiser of a step whose terms join late, as L-BFGS ends by it too, and options that it shares.
ENDING = {"method": "newton", "reuse": True, "start_projected": True}
LIMITS = ("tolerance", "max_iterations", "timeout")


class StepMinimiser:
    """Minimiser of the potential of a step, from where the step starts and a first guess of its end.

    The user of `potential`, inertia included, freezes it before each step. options: see `TimeStepper`.

    Attributes:
        options: as given, with the method by default: "newton" with a term whose pairs change, else
            "lbfgs", whose preconditioner knows nothing of pairs that come and go.
        opening_method: of the minimisation without the terms that join late; "" where none does.
    """

    def __init__(self, potential: Potential, **options: Any) -> None:
        self.potential = potential
        self._late = [energy for energy in potential.energies if energy.dynamic]
        self.options = {"method": "newton" if self._late else "lbfgs"} | options
        self.opening_method, self._ending = "", self.options
        self._opening: Minimiser | None = None
        if self._late:
            if callable(self.options["method"]):
                raise ValueError(
                    f"simulate: method is a function, but Newton ends steps with {self._late[0].name!r}: "
                    "choose 'lbfgs' or 'newton', or leave the term out"
                )
            early = Potential([energy for energy in potential.energies if not energy.dynamic])
            self.opening_method = options.get("method", "lbfgs")
            self._opening = make_minimiser(early, **options | {"method": self.opening_method})
            self._ending = ENDING | {name: options[name] for name in LIMITS if name in options}
        self._minimiser = make_minimiser(potential, **self._ending)

    def start_again(self) -> None:
        """Let the next run give the bits of a first one."""
        self.__dict__.pop("_rough_minimiser", None)
        for minimiser in filter(None, (self._opening, self._minimiser)):
            minimiser.start_again()

    def minimise(self, x: np.ndarray, guess: np.ndarray) -> Result:
        """Minimise the step that starts at x (V, 3) [m], from `guess` (V, 3) [m] or from as near as x comes.

        Counts of the result are those of all its minimisations together. Dynamic terms are left
        out first, and stay out unless they have something to say: the minimum without them is the answer
        if the way there is free and they are zero around it. If not, the minimisation with them starts on
        the way there: from `guess` on if that can be reached, else from x on. Cloth meets itself late on
        such a way, for a guess moves it with the body.
        """
        if not self._opening or not np.isfinite(guess).all():
            return self.minimise_from(guess)  # which reports a divergence
        potential, opened = self.potential, self._opening.minimise(guess)
        y = opened.positions if np.isfinite(opened.positions).all() else guess
        free = potential.ccd_fraction(x, y) == 1
        terms = potential.terms(y)
        if free and opened.status == "converged" and not any(terms[term.name] for term in self._late):
            return replace(opened, terms=terms)
        if not free and potential.ccd_fraction(x, guess) == 1:
            x = guess
        return _merge(opened, self._approach(x, y))

    def minimise_from(self, x: np.ndarray) -> Result:
        """Minimise from x (V, 3) [m], to which no collision bars the way."""
        return self._minimiser.minimise(x)

    def _approach(self, x: np.ndarray, guess: np.ndarray) -> Result:
        """Minimise from `guess`, or from as near to it as terms that nothing may pass through let x come.

        All vertices move from x to the guess until something would touch. From there pins go on alone; if
        they cannot, a rough minimisation gains distance, and all move on. So the last minimisation starts
        without an intersection, pins at the end of their way.
        """
        potential, pins = self.potential, self.potential.cloth.pins
        motion, goal, progress = guess - x, guess, 0.0
        history, begun, late = [0.0], time.perf_counter(), False
        rough: list[Result] = []
        while len(history) <= MAX_APPROACHES and not late:
            shares: list[float] = []
            for free_too in (True, False):
                if not free_too:
                    goal = x.copy()
                    goal[pins] = guess[pins]
                share = potential.ccd_fraction(x, goal)
                if share == 1:
                    potential.search_again()
                    return _merge(*rough, self.minimise_from(goal))
                if share >= max(shares, default=0.0):
                    part = APPROACH_SHARE * share
                    x, progress = x + part * (goal - x), progress + part * (1 - progress)
                shares.append(share)
            potential.search_again()
            rough.append(self._rough_minimiser.minimise(x))
            x = rough[-1].positions
            goal = x + (1 - progress) * motion
            goal[pins] = guess[pins]
            history.append(progress)
            late = time.perf_counter() - begun > self.options.get("timeout", float("inf"))
            if progress - history[max(len(history) - 4, 0)] < LEAST_APPROACH and len(history) > 3:
                break
        result = _merge(*rough, self.minimise_from(x))
        if result.status == "diverged":
            return result
        status = max("stalled", "timeout" if late else result.status, key=STATUSES.__getitem__)
        problem = "no way without intersection" if status == "stalled" else "gave up after the timeout"
        return replace(result, status=status, reason=f"{problem}: pins came {progress:.1%} of their way")

    @cached_property
    def _rough_minimiser(self) -> Minimiser:
        """Minimiser of few iterations, which gains distance half-way."""
        options: dict[str, Any] = self._ending | {"max_iterations": 8, "tolerance": 1e-2}
        return make_minimiser(self.potential, **options)


def _merge(*results: Result) -> Result:
    """Return the last result with the counts of all."""
    return replace(
        results[-1],
        iterations=sum(result.iterations for result in results),
        factorisations=sum(result.factorisations for result in results),
    )
