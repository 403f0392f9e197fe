"""The energies that newton's solvers minimise, written from their sources in float64 on our stencils.

SolverVBD (evaluate_neo_hookean_membrane_force_hessian), per triangle of rest area A:
    E = A [mu/2 (|F|^2 - 2) + L/2 (J - a)^2] + const,  J = |f0 x f1|,  L = lambda + mu,  a = 1 + mu/L
with tri_ke = mu and tri_ka = lambda [N/m]; its stress vanishes at rest, and its second derivatives there are
those of StVK. Left out: its floor of 1e-10 under J. Constant chosen so that E = 0 at rest. Its bending
(evaluate_dihedral_angle_based_bending_force_hessian) is edge_ke l0/2 theta^2: our BendHinge for
edge_ke = k s/l0, s = l0^2/(4 (A1 + A2)). Damping 0.

SolverXPBD has no triangles. Its springs (solve_springs) are constraints |d| - l0 of compliance
1/spring_ke, whose fixed point is the minimum of inertia + sum spring_ke/2 (|d| - l0)^2. Its bending
(bending_constraint) moves vertices along the gradient of theta times twice the area of the triangle, so it
has no exact energy; for edge_ke = k s/(A1 + A2) it pulls as BendHinge does while triangles keep their area.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.engines.newton_cloth import spring_stiffness
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.energy import Energy

if TYPE_CHECKING:
    from torch import Tensor


class StableNeoHookean(Energy):
    """SolverVBD's membrane [J] on each face, with the membrane constants of `cloth`; derivatives by torch."""

    name = "neo-hookean"

    def __init__(self, cloth: Cloth) -> None:
        self.cloth = cloth
        self.stencils = cloth.faces
        self.mu, self.lam = cloth.material.lame_mu, cloth.material.lame_lambda

    def element_energy(self, u: Tensor) -> Tensor:
        """Return the energy (N,) [J] of each element at u (N, k, 3) [m]."""
        import torch

        area = torch.as_tensor(self.cloth.areas).to(u)
        Ds = torch.stack([u[..., 1, :] - u[..., 0, :], u[..., 2, :] - u[..., 0, :]], dim=-1)
        F = Ds @ torch.as_tensor(self.cloth.Dm_inverse).to(u)
        J = torch.linalg.vector_norm(torch.linalg.cross(F[..., 0], F[..., 1]), dim=-1)
        L = self.lam + self.mu
        offset = self.mu / L
        stretch = 0.5 * self.mu * ((F * F).sum((-1, -2)) - 2)
        return area * (stretch + 0.5 * L * ((J - 1 - offset) ** 2 - offset**2))


class UnequalSprings(Energy):
    """SolverXPBD's springs [J] on each edge, k/2 (l - l0)^2 with a stiffness of its own for each edge."""

    name = "springs"

    def __init__(self, cloth: Cloth) -> None:
        self.cloth = cloth
        self.stencils = cloth.edges
        self.stiffness = spring_stiffness(cloth)

    def element_energy(self, u: Tensor) -> Tensor:
        """Return the energy (N,) [J] of each element at u (N, k, 3) [m]."""
        import torch

        length = torch.linalg.vector_norm(u[..., 1, :] - u[..., 0, :], dim=-1)
        rest = torch.as_tensor(self.cloth.edge_lengths).to(u)
        return 0.5 * torch.as_tensor(self.stiffness).to(u) * (length - rest) ** 2


def energies_of(solver: str, cloth: Cloth) -> tuple[Energy, ...]:
    """Return the static terms that "VBD" or "XPBD" minimises, gravity aside; none for "Style3D"."""
    membranes: dict[str, type[StableNeoHookean] | type[UnequalSprings]] = {
        "VBD": StableNeoHookean, "XPBD": UnequalSprings,
    }  # fmt: skip
    return (membranes[solver](cloth), BendHinge(cloth)) if solver in membranes else ()
