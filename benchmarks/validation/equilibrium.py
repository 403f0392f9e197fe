"""Parts that known answers share: flat cloths, solves that have to converge, orders, the dead load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, lying
from reference_sim import energies

if TYPE_CHECKING:
    from torch import Tensor

Solved = TypeVar("Solved", "sim.Result", "sim.Trajectory")
COTTON = sim.Material()


def border(points: np.ndarray) -> np.ndarray:
    """Return which points (V, 2) [m] lie on the border of their rectangle, (V,)."""
    return ((points < points.min(axis=0) + 1e-9) | (points > points.max(axis=0) - 1e-9)).any(axis=1)


def ends(points: np.ndarray) -> np.ndarray:
    """Return which points (V, 2) [m] lie at one of the ends of their rectangle along x, (V,)."""
    return border(points[:, :1])


def flat_cloth(
    points: np.ndarray,
    faces: np.ndarray,
    material: sim.Material = COTTON,
    *,
    held: np.ndarray | Sequence[bool] = (),
    lies: bool = False,
    size: float = 1.0,
) -> sim.Cloth:
    """Make a cloth of `size` times points (V, 2) [m] in the plane z = 0, or y = 0, facing up, if it `lies`.

    held: which vertices are pinned, (V,).
    """
    x, faces = (lying(points), faces[:, ::-1]) if lies else (in_space(points), faces)
    return sim.Cloth(size * x, faces, material, pins=np.flatnonzero(held))


def sheet_terms(cloth: sim.Cloth) -> list[energies.Energy]:
    """Return membrane, hinges and weight."""
    return [energies.StretchStVK(cloth), energies.BendHinge(cloth), energies.Gravity(cloth)]


class DeadLoad(energies.Energy):
    """Dead load of each vertex, E = -f . x with constant forces f (V, 3) [N]."""

    name = "load"

    def __init__(self, cloth: sim.Cloth, forces: np.ndarray) -> None:
        self.cloth, self.forces = cloth, forces
        self.stencils = np.arange(cloth.vertex_count)[:, None]

    def element_energy(self, u: Tensor) -> Tensor:
        """Return -f . u of each vertex, in torch."""
        import torch

        return -(torch.as_tensor(self.forces).to(u) * u[..., 0, :]).sum(-1)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the energy [J] and its gradient -f (V, 3) [N]."""
        return -float(np.vdot(self.forces, x)), -self.forces


def demand_converged(solved: Solved, name: str) -> Solved:
    """Return the result. Raises RuntimeError with `name`, status and reason unless it converged."""
    if solved.status != "converged":
        raise RuntimeError(f"{name} ended as {solved.status}: {solved.reason}")
    return solved


def minimum(terms: Sequence[energies.Energy], start: np.ndarray, **options: Any) -> np.ndarray:
    """Return the minimum (V, 3) [m] of the sum of these terms found from `start` (V, 3) [m].

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
    return fit_order([error(n) for n in counts], [whole / n for n in counts])


def fit_order(errors: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the slope of log error over log size by least squares; nan unless errors are above 0."""
    if not (np.isfinite(errors).all() and np.min(errors) > 0):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
