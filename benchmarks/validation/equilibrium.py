"""Dead load: a constant force, the term that loads a structure in a check."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

import reference_sim as sim
from reference_sim import energies

if TYPE_CHECKING:
    from torch import Tensor


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


Solved = TypeVar("Solved", "sim.Result", "sim.Trajectory")


def demand_converged(solved: Solved, name: str) -> Solved:
    """Return the result itself. Raises RuntimeError with `name`, status and reason unless it converged."""
    if solved.status != "converged":
        raise RuntimeError(f"{name} ended as {solved.status}: {solved.reason}")
    return solved


def fitted_order(errors: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the slope of log error over log size by least squares; nan for errors of zero or not finite.

    >>> round(fitted_order([4e-3, 1e-3, 2.5e-4], [1, 0.5, 0.25]), 6)
    2.0
    """
    if not (np.isfinite(errors).all() and np.min(errors) > 0):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
