"""Minimisers by name: same call, same type of result."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np

from reference_sim.minimise.lbfgs import LBFGS
from reference_sim.minimise.newton import Newton
from reference_sim.minimise.result import Result
from reference_sim.potential import Potential


class Minimiser(Protocol):
    """Solver bound to one potential, so that symbolic analysis is done once for all steps."""

    def minimise(self, x0: np.ndarray) -> Result:
        """Minimise from x0 (V, 3) [m]; pinned vertices stay where x0 has them."""
        ...


@runtime_checkable
class Restartable(Minimiser, Protocol):
    """Minimiser that can serve run after run: after `start_again` it gives the bits of a new one."""

    def start_again(self) -> None:
        """Forget what earlier minimisations have taught."""
        ...


MINIMISERS: dict[str, Callable[..., Minimiser]] = {"newton": Newton, "lbfgs": LBFGS}


def make_minimiser(
    potential: Potential, method: str | Callable[..., Minimiser] = "newton", **options: Any
) -> Minimiser:
    """Return a minimiser by name, for a caller that minimises the same potential again and again.

    Args:
        potential: the sum of energies.
        method: a name in MINIMISERS, or a function that is called as `method(potential, **options)`.
        options: of the method's class.

    Raises:
        ValueError: unknown name.

    >>> from reference_sim import Cloth, Material, Potential
    >>> from reference_sim.energies import StretchStVK
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> cloth = Cloth(square, np.array([[0, 1, 2], [0, 2, 3]]), Material(), pins=[0, 1])
    >>> minimiser = make_minimiser(Potential([StretchStVK(cloth)]), "newton")
    >>> minimiser.minimise(1.01 * square).status
    'converged'
    """
    if callable(method):
        return method(potential, **options)
    if method not in MINIMISERS:
        raise ValueError(f"unknown minimiser {method!r}: choose one of {', '.join(MINIMISERS)}")
    return MINIMISERS[method](potential, **options)


def minimise(potential: Potential, x0: np.ndarray, method: str = "newton", **options: Any) -> Result:
    """Minimise `potential` from x0; pinned vertices stay where x0 has them.

    Args:
        potential: the sum of energies.
        x0: (V, 3) [m].
        method: "newton" or "lbfgs".
        options: of the method's class, `Newton` or `LBFGS`: tolerance, max_iterations, timeout, ...

    Returns:
        The Result. Failure is a status in it, not an exception.

    Raises:
        ValueError: unknown method, or a tolerance that is no number above 0.

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
