"""Minimisers of a Potential: same call, same result type, one file each."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from reference_sim.minimise.lbfgs import LBFGS
from reference_sim.minimise.newton import Newton
from reference_sim.minimise.result import STATUSES, Result
from reference_sim.potential import Potential

METHODS = {"newton": Newton, "lbfgs": LBFGS}

__all__ = ["LBFGS", "METHODS", "STATUSES", "Minimiser", "Newton", "Result", "make_minimiser", "minimise"]


class Minimiser(Protocol):
    """Bound to one potential, so that symbolic analysis is done once for all steps."""

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from x0 (V, 3) [m]; pinned vertices stay where x0 has them."""
        ...


def make_minimiser(
    potential: Potential, method: str | Callable[..., Minimiser] = "newton", **options: Any
) -> Minimiser:
    """A minimiser by name ("newton" or "lbfgs"), or made by `method(potential, **options)`.

    Raises ValueError for an unknown name.
    """
    if callable(method):
        return method(potential, **options)
    if method not in METHODS:
        raise ValueError(f"unknown minimiser {method!r}: choose one of {', '.join(METHODS)}")
    return METHODS[method](potential, **options)


def minimise(potential: Potential, x0: np.ndarray, method: str = "newton", **options: Any) -> Result:
    """Minimise `potential` from x0 (V, 3) [m]; pinned vertices stay where x0 has them.

    Options are those of the method's class. Failure is a status in the result, not an exception.
    """
    return make_minimiser(potential, method, **options).minimise(x0)
