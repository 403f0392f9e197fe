"""Backward Euler's inertia: E = m / (2 dt^2) |x - x_hat|^2 with x_hat = x_t + dt v_t (SNUG, eq. 3 and 4).

x_hat holds no gravity: the weight is a term of its own, so a body in free fall carries m g^2 dt^2 / 2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, Step, demand_positive
from reference_sim.kernels.fast_kernels import LANES, BatchKernel

if TYPE_CHECKING:
    from torch import Tensor


class Inertia(Energy):
    """Incremental kinetic term [J] of each vertex; `prepare` (or the argument x_hat) sets the target."""

    name = "inertia"
    constant = (1, 3)

    def __init__(self, cloth: Cloth, dt: float) -> None:
        demand_positive("Inertia", dt=dt)
        self.cloth = cloth
        self.stencils = np.arange(cloth.vertex_count)[:, None]
        self.dt = float(dt)
        self.masses = cloth.masses
        self.x_hat = cloth.rest_positions

    def parameters(self) -> dict[str, Any]:
        """Return dt [s]."""
        return {"dt_s": self.dt}

    def prepare(self, step: Step) -> None:
        """Set x_hat = x_t + dt v_t."""
        self.x_hat = step.previous + step.dt * step.velocity

    def energy(self, x: Tensor, *state: Tensor) -> Tensor:
        """Return E [J] (..., V) of each vertex at x (..., V, 3) [m]; state: x_hat, else the prepared one."""
        import torch

        (target,) = state or (torch.as_tensor(self.x_hat).to(x),)
        mass = torch.as_tensor(self.masses).to(x)
        return 0.5 / self.dt**2 * mass * ((x - target) ** 2).sum(-1)

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each vertex: u (..., N, 1, 3) [m] -> (..., N)."""
        return self.energy(u[..., 0, :])

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        offset = x - self.x_hat
        gradient = (self.masses / self.dt**2)[:, None] * offset
        return 0.5 * float(np.einsum("vi,vi", gradient, offset)), gradient  # BLAS would start threads

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        """Return the second derivatives (N, 3, 3) [N/m] of each vertex at x (V, 3) [m]."""
        return (self.masses / self.dt**2)[:, None, None] * np.eye(3)

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the vertices (V,) and m / dt^2 (V, 1, 1) [N/m]."""
        return np.arange(len(self.masses)), (self.masses / self.dt**2)[:, None, None]


def batch_of_windows(term: Inertia, ahead: np.ndarray, windows: int, weight: float = 1.0) -> BatchKernel:
    """Return the kernel of training on a CPU, of windows that fill whole blocks.

    E = weight m / (2 dt^2) |a|^2 with a = x_t - 2 x_{t-1} + x_{t-2} - ahead_t, zero for the first two
    frames. ahead (C, 3, LANES) [m]: where the frame before would be if nothing pulled, seen from
    where it is.
    """
    stiffness = (weight * term.masses / term.dt**2).astype(np.float32)[:, None, None]
    one = windows // LANES  # blocks a frame

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        a = x[2 * one :] - x[one:-one]
        a -= x[one:-one]
        a += x[: -2 * one]
        a -= ahead[2 * one :, None]
        force = stiffness * a
        gradients[2 * one :] += force
        a *= force
        values = np.zeros((len(x), LANES), np.float32)
        values[2 * one :] = 0.5 * a.sum((1, 2), dtype=np.float64)
        gradients[: -2 * one] += force
        force += force
        gradients[one:-one] -= force
        return values

    return run
