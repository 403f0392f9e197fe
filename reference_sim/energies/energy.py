"""Base class of the physical terms: a definition in torch on one stencil, and its derivatives.

Gradient and Hessian follow from the definition by automatic differentiation; a term may override them
with closed-form kernels in its own file, and declare further kernels for solvers and training. The test
tests/reference_sim/energies/test_derivatives.py holds every override to the default.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

if TYPE_CHECKING:
    import scipy.sparse as sp
    from torch import Tensor

    from reference_sim.cloth import Cloth
    from reference_sim.kernels.lanes import BlockPlaces
    from reference_sim.obstacle import Obstacle


@dataclass(frozen=True)
class Step:
    """State before one backward-Euler step, as a term may read it, frozen during the step."""

    previous: np.ndarray  # (V, 3) [m] at the start
    velocity: np.ndarray  # (V, 3) [m/s] at the start
    guess: np.ndarray  # (V, 3) [m], initial guess of the end
    dt: float  # [s]
    obstacle: Obstacle | None = None
    frame: int = 0  # of the obstacle at the end of the step


# What follows from the definition of a term, unless its class has a closed form.
DERIVATIVES = (
    "value_and_gradient", "hessian_blocks", "active_hessian_blocks", "add_hessian", "scalar_stiffness",
)  # fmt: skip


def demand_positive(term: str, *, or_zero: bool = False, **numbers: float) -> None:
    """Raise ValueError unless all numbers of the term so named are finite and above 0."""
    for name, value in numbers.items():
        if not (math.isfinite(value) and (value > 0 or (or_zero and value == 0))):
            bound = "at least 0" if or_zero else "above 0"
            raise ValueError(f"{term} {name} = {value!r}: must be a finite number {bound}")


class Energy:
    """One physical term on one stencil.

    Attributes:
        dynamic: True where the vertices that the term couples change with x, as the pairs of a contact
            do. Such a term has no stencils (N = 0); it gives `sparse_hessian` instead of blocks. A step
            is minimised without it first, for it is zero wherever nothing is near.
        constant: block sizes (3: Hessian, 1: scalar stiffness) of which the term gives the same at every
            x and in every step.
        remembers: whether `prepare` reads the step before, which then has to be prepared first to evaluate
            a single step.
        kernels: functions by use, see kernels.fast_kernels. A subclass does not inherit them.
    """

    name: str  # in tables; a potential has no two terms of one name
    cloth: Cloth  # the rest state that the term was built on
    stencils: np.ndarray  # (N, k) vertex indices of each element
    dynamic: bool = False
    constant: tuple[int, ...] = ()
    remembers: bool = False
    kernels: ClassVar[Mapping[str, Callable[[Any], Any]]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        """Raise TypeError for a definition of its own that would inherit the closed forms of another."""
        super().__init_subclass__(**options)
        attributes = vars(cls)
        if {"element_energy", "power"}.isdisjoint(attributes):
            return
        inherited = [name for name in DERIVATIVES if name not in attributes]
        if foreign := [name for name in inherited if getattr(cls, name) is not getattr(Energy, name)]:
            lines = "; ".join(f"{name} = Energy.{name}" for name in foreign)
            raise TypeError(f"{cls.__name__} would inherit closed forms of another energy: write {lines}")

    def energy(self, x: Tensor, *state: Tensor) -> Tensor:
        """Return the energy of each element [J]: x (..., V, 3) [m] -> (..., N). This is the definition.

        state: in place of what `prepare` has frozen, where `element_energy` takes it.
        """
        import torch

        index = torch.as_tensor(self.stencils, device=x.device)
        return self.element_energy(x[..., index, :], *state)

    def element_energy(self, u: Tensor) -> Tensor:
        """Return the energy of each element from its own vertices: u (..., N, k, 3) [m] -> (..., N) [J]."""
        raise NotImplementedError(f"{type(self).__name__} defines no element_energy")

    def prepare(self, step: Step) -> None:
        """Freeze what this term needs for one step; most terms need nothing."""

    def parameters(self) -> dict[str, Any]:
        """Return the numbers that identify the term in a result file."""
        return {}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what belongs to each element of the term, by name: enough to evaluate it elsewhere.

        Names end in their unit; "vertices" (N, k) are the stencils.
        """
        return {"vertices": self.stencils}

    def check_positions(self, x: np.ndarray) -> np.ndarray:
        """Return x (V, 3) for kernels, which look at no bounds. Raises ValueError for another shape."""
        x = np.ascontiguousarray(x, dtype=np.float64)
        if x.shape != (shape := (self.cloth.vertex_count, 3)):
            raise ValueError(f"positions have shape {x.shape}: expected {shape} [m]")
        return x

    def _elements(self, x: np.ndarray) -> Tensor:
        import torch

        u = torch.as_tensor(self.check_positions(x)[self.stencils])
        return u.requires_grad_(True)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum over elements [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        import torch

        u = self._elements(x)
        value = self.element_energy(u).sum()
        (local,) = torch.autograd.grad(value, u)
        gradient = np.zeros((len(x), 3))
        np.add.at(gradient, self.stencils.ravel(), local.reshape(-1, 3).numpy())
        return float(value.detach()), gradient

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        """Return the second derivatives of each element at x (V, 3): (N, 3k, 3k) [N/m]."""
        import torch

        u = self._elements(x)
        (local,) = torch.autograd.grad(self.element_energy(u).sum(), u, create_graph=True)
        local = local.flatten(-2)
        if not local.requires_grad:  # linear in x
            return np.zeros((*local.shape, local.shape[-1]))
        rows = [
            torch.autograd.grad(local[:, i].sum(), u, retain_graph=True, allow_unused=True)[0]
            for i in range(local.shape[1])
        ]
        zero = torch.zeros_like(u)
        return torch.stack([(zero if r is None else r).flatten(-2) for r in rows], dim=1).numpy()

    def active_hessian_blocks(self, x: np.ndarray, convexity: float) -> tuple[np.ndarray, np.ndarray]:
        """Return elements (n,) with a Hessian at x (V, 3) [m] and their blocks (n, 3k, 3k) [N/m].

        convexity: share of the negative curvature that is taken out: 0 gives the true second derivatives,
        1 positive semi-definite blocks. Here by automatic differentiation and eigenvalues.
        """
        blocks = self.hessian_blocks(x)
        if convexity > 0:
            values, vectors = np.linalg.eigh(blocks)
            values = np.where(values < 0, (1 - convexity) * values, values)
            blocks = (vectors * values[:, None, :]) @ vectors.transpose(0, 2, 1)
        return np.arange(len(self.stencils)), blocks

    def add_hessian(self, x: np.ndarray, convexity: float, places: BlockPlaces, data: np.ndarray) -> None:
        """Add the second derivatives at x (V, 3) [m] to the values `data` of a matrix, for the solver.

        A term with a closed form stores no blocks, and takes out its negative curvature where it sits.
        """
        places.add(*self.active_hessian_blocks(x, convexity), data)

    def sparse_hessian(self, x: np.ndarray, convexity: float = 0.0) -> sp.csc_matrix:
        """Return the second derivatives (3V, 3V) [N/m] of a dynamic term at x (V, 3) [m].

        convexity is that of `active_hessian_blocks`.
        """
        raise NotImplementedError

    def largest_step(self, x: np.ndarray, direction: np.ndarray) -> float:
        """Return the largest share of `direction` (V, 3) [m] that may be gone from x (V, 3), 1 at most.

        For terms that are infinite beyond a first touch.
        """
        return 1.0

    def ccd_fraction(self, x: np.ndarray, goal: np.ndarray) -> float:
        """Return the share (0 to 1) of the way from x (V, 3) to goal (V, 3) [m] without a collision."""
        return 1.0

    def search_again(self) -> None:
        """Forget what was found near, as `prepare` does at the beginning of a step."""

    def predict_stress(self, x: np.ndarray, step: np.ndarray) -> None:
        """Let the Hessian take, until `forget`, the stresses that linear strain predicts at x + step (V, 3).

        Energy and gradient know nothing of it. For stiff terms whose Hessian holds stress.
        """

    def forget(self) -> None:
        """Let the Hessian be the true second derivatives again."""

    def infeasibility(self, x: np.ndarray) -> str:
        """Say what makes x (V, 3) impossible for this term, with the elements; "" if nothing does."""
        return ""

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a positive semi-definite stand-in for the Hessian that treats x, y and z alike.

        It is elements (n,) and matrices (n, k, k) [N/m] over their vertices, for preconditioning. Terms
        without one are left out of a preconditioner.
        """
        raise NotImplementedError
