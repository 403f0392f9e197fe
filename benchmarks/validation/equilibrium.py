"""Solves that have to converge, the order of an error, and the dead load: what known answers share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

import reference_sim as sim
from reference_sim import energies

if TYPE_CHECKING:
    from torch import Tensor

Solved = TypeVar("Solved", "sim.Result", "sim.Trajectory")


class DeadLoad(energies.Energy):
    """Dead load of each vertex, E = -f . x with constant forces f (V, 3) [N]."""

    name = "load"

    def __init__(self, cloth: sim.Cloth, forces: np.ndarray) -> None:
        self.cloth = cloth
        self.stencils = np.arange(cloth.vertex_count)[:, None]
        self.forces = forces

    def element_energy(self, u: Tensor) -> Tensor:
        """Return -f . u of each vertex, in torch."""
        import torch

        return -(torch.as_tensor(self.forces).to(u) * u[..., 0, :]).sum(-1)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the energy [J] and its gradient -f (V, 3) [N]."""
        return -float(np.vdot(self.forces, x)), -self.forces


def demand_converged(solved: Solved, name: str) -> Solved:
    """Return the result itself. Raises RuntimeError with `name`, status and reason unless it converged."""
    if solved.status != "converged":
        raise RuntimeError(f"{name} ended as {solved.status}: {solved.reason}")
    return solved


def minimum(terms: Sequence[energies.Energy], start: np.ndarray, **options: Any) -> np.ndarray:
    """Return the minimum (V, 3) [m] of the sum of these terms that is found from `start` (V, 3) [m].

    options: of `minimise`. Raises RuntimeError unless it converged.
    """
    result = sim.minimise(sim.Potential(list(terms)), start, **options)
    return demand_converged(result, "the search for a minimum").positions


def motion(cloth: sim.Cloth, terms: Sequence[energies.Energy], **options: Any) -> np.ndarray:
    """Return the simulated positions (T, V, 3) [m]; options: of `simulate`. Raises RuntimeError likewise."""
    return demand_converged(sim.simulate(cloth, terms, **options), "the simulation").positions


def farthest(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest distance of two arrays of points (..., n)."""
    return float(np.linalg.norm(one - other, axis=-1).max())


def order(error: Callable[[int], float], counts: Sequence[int], whole: float = 1.0) -> float:
    """Return the order of `error` in the size whole / n, over these counts n of equal parts.

    >>> round(order(lambda n: 4.0 / n**2, (8, 16, 32)), 6)
    2.0
    """
    return fitted_order([error(n) for n in counts], [whole / n for n in counts])


def fitted_order(errors: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the slope of log error over log size by least squares; nan for errors of zero or not finite."""
    if not (np.isfinite(errors).all() and np.min(errors) > 0):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
