"""Cloth of NVIDIA's newton: vertex block descent (VBD), XPBD and Style3D, in float32; two of them as methods.

How our material becomes newton's (its units are SI; tri_ and edge_ parameters as its kernels use them):
    particle mass   our lumped mass; 0 at pins, which makes a particle kinematic
    gravity         (0, -9.81, 0) m/s^2
    tri_ke, tri_ka  mu, lambda of the membrane [N/m]                       VBD
    edge_ke         k s / l0 [J/m], k s / (A1 + A2) [J/m^2] per inner edge  VBD, XPBD
    spring_ke       E2 (A1 + A2) / l0^2 [N/m] per edge                     XPBD, which ignores triangles
    tri_aniso_ke    E2, E2, mu [N/m]: no Poisson effect                    Style3D
    edge_aniso_ke   k / 12 [J]: 3 l0^2 / (A1 + A2) of it is k s            Style3D
    damping, drag, lift, particle radius, contacts: 0, none
with s = l0^2 / (4 (A1 + A2)). So VBD's membrane is stable Neo-Hookean, close to ours at small strain and
not at large, XPBD has springs, and Style3D stretches the two axes apart from each other.

The energies of VBD and XPBD are written from their sources in float64 on our stencils; Style3D's shear
force is not the gradient of an energy. SolverVBD (evaluate_neo_hookean_membrane_force_hessian) has, per
triangle of rest area A,
    E = A [mu/2 (|F|^2 - 2) + L/2 (J - a)^2] + const,  J = |f0 x f1|,  L = lambda + mu,  a = 1 + mu/L
with tri_ke = mu and tri_ka = lambda [N/m]; its stress vanishes at rest, and its second derivatives there
are those of StVK. Left out: its floor of 1e-10 under J. Constant chosen so that E = 0 at rest. Its
bending (evaluate_dihedral_angle_based_bending_force_hessian) is edge_ke l0/2 theta^2: our BendHinge for
edge_ke = k s/l0.
SolverXPBD has no triangles. Its springs (solve_springs) are constraints |d| - l0 of compliance
1/spring_ke, whose fixed point is the minimum of inertia + sum spring_ke/2 (|d| - l0)^2. Its bending
(bending_constraint) moves vertices along the gradient of theta times twice the area of the triangle, so
it has no exact energy; for edge_ke = k s/(A1 + A2) it pulls as BendHinge does while triangles keep their
area.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import BuiltScene, Method, MethodEntry
from engine_runs import FAR, EngineCloth
from reference_sim import GRAVITY, Cloth, Trajectory
from reference_sim.energies import BendHinge, Energy

if TYPE_CHECKING:
    from torch import Tensor

METHODS = tuple(
    MethodEntry(
        name=f"newton-{solver.lower()}", label=f"newton's {solver}", dtype="float32", package="newton",
        description=f"newton's {solver} on its own energies, {iterations} x {substeps} a frame",
        options={"solver": solver, "iterations": iterations, "substeps": substeps},
        needs_no_obstacle=True, role="external",
    )
    for solver, iterations, substeps in (("VBD", 10, 20), ("XPBD", 1, 128))
)  # fmt: skip


class NewtonCloth(EngineCloth):
    """Solver of newton bound to one cloth.

    Args:
        cloth: that moves.
        iterations: of the solver in each time step.
        solver: "VBD", "XPBD" or "Style3D".

    Raises:
        ImportError: newton is not installed.
    """

    def __init__(self, cloth: Cloth, iterations: int, solver: str) -> None:
        import warp

        warp.config.log_level = warp.LOG_ERROR
        import newton

        if solver != "Style3D":
            membrane = StableNeoHookean(cloth) if solver == "VBD" else UnequalSprings(cloth)
            self.energies = (membrane, BendHinge(cloth))
        self.model = build_model(cloth, solver)
        solvers = newton.solvers
        if solver == "Style3D":
            config = solvers.SolverStyle3D.Config(iterations=iterations)
            self._solver: Any = solvers.SolverStyle3D(self.model, config=config)
            self._solver.collision = None
        else:
            make = {"VBD": solvers.SolverVBD, "XPBD": solvers.SolverXPBD}[solver]
            self._solver = make(self.model, iterations=iterations)
        self._states = self.model.state(), self.model.state()

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (V, 3) [m] and velocities [m/s] a time step of dt [s] later, in float64."""
        now, then = self._states
        now.particle_q.assign(x.astype(np.float32))
        now.particle_qd.assign(v.astype(np.float32))
        self._solver.step(now, then, None, None, dt)
        return then.particle_q.numpy().astype(np.float64), then.particle_qd.numpy().astype(np.float64)


def build_model(cloth: Cloth, solver: str) -> Any:
    """Build the newton.Model of `cloth` for "VBD", "XPBD" or "Style3D", by the table above."""
    import newton

    if cloth.rest_uv is not None:
        raise ValueError(
            "newton takes the rest shape from positions in space: this cloth's is a UV chart"
        )
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -GRAVITY, 0.0))
    if solver == "Style3D":
        _add_style3d(builder, cloth)
        return builder.finalize(device="cpu")
    builder.add_cloth_mesh(
        **_placed(cloth), scale=1.0, tri_ke=cloth.material.lame_mu, tri_ka=cloth.material.lame_lambda,
        tri_kd=0.0, edge_ke=0.0, edge_kd=0.0,
    )  # fmt: skip
    _set_masses(builder, cloth)
    edges = np.array(builder.edge_indices)
    rest_angle = builder.edge_rest_angle
    rest_angle[:] = [0.0] * len(rest_angle)  # what BendHinge takes by default
    length, areas = np.array(builder.edge_rest_length), areas_beside(cloth, edges[:, 2:])
    stiffness = cloth.material.bending_stiffness * length**2 / (4 * areas)  # and this
    stiffness = stiffness / (length if solver == "VBD" else areas)
    stiffness = np.where((edges >= 0).all(axis=1), stiffness, 0.0)
    builder.edge_bending_properties[:] = [(float(ke), 0.0) for ke in stiffness]
    if solver == "XPBD":
        for (i, j), ke in zip(cloth.edges.tolist(), spring_stiffness(cloth)):
            builder.add_spring(i, j, float(ke), 0.0, control=0.0)
    else:
        builder.color(include_bending=True)
    return builder.finalize(device="cpu")


def _add_style3d(builder: Any, cloth: Cloth) -> None:
    """Add a flat cloth with the attributes of Style3D; its panel is the plane that it lies in."""
    import newton
    import warp
    from newton.solvers import style3d

    newton.solvers.SolverStyle3D.register_custom_attributes(builder)
    material, x = cloth.material, cloth.rest_positions
    panel = np.delete(x, np.ptp(x, axis=0).argmin(), axis=1)
    first, second = (panel[cloth.faces[0, k]] - panel[cloth.faces[0, 0]] for k in (1, 2))
    if first[0] * second[1] < first[1] * second[0]:  # a panel's triangles are counter-clockwise
        panel = panel * [-1.0, 1.0]
    tension, bending = material.membrane_modulus, material.bending_stiffness / 12
    style3d.add_cloth_mesh(
        builder, **_placed(cloth), panel_verts=panel.tolist(),
        tri_aniso_ke=warp.vec3(tension, tension, material.lame_mu),
        edge_aniso_ke=warp.vec3(bending, bending, bending),
    )  # fmt: skip
    _set_masses(builder, cloth)


def _placed(cloth: Cloth) -> dict[str, Any]:
    """Return mesh, place and density of the cloth, without drag, lift and radius."""
    import warp

    return {
        "pos": warp.vec3(0.0, 0.0, 0.0), "rot": warp.quat_identity(), "vel": warp.vec3(0.0, 0.0, 0.0),
        "vertices": cloth.rest_positions.tolist(), "indices": cloth.faces.ravel().tolist(),
        "density": cloth.material.areal_density, "tri_drag": 0.0, "tri_lift": 0.0, "particle_radius": 0.0,
    }  # fmt: skip


def _set_masses(builder: Any, cloth: Cloth) -> None:
    """Give the particles the masses of the cloth, and pins none, which holds them."""
    builder.particle_mass[:] = cloth.masses.tolist()
    for pin in cloth.pins:
        builder.particle_mass[pin] = 0.0


def spring_stiffness(cloth: Cloth) -> np.ndarray:
    """Return E2 (A1 + A2)/l0^2 (E,) [N/m] of `cloth.edges`, near an isotropic sheet of modulus E2.

    The area-weighted springs of Van Gelder (1998). They cannot have our Poisson ratio.
    """
    areas = areas_beside(cloth, cloth.edges)
    return cloth.material.membrane_modulus * areas / cloth.edge_lengths**2


def areas_beside(cloth: Cloth, edges: np.ndarray) -> np.ndarray:
    """Return the area (E,) [m^2] of the one or two faces beside each of some edges (E, 2) of the cloth."""
    key = np.array([cloth.vertex_count, 1])
    areas = np.bincount(cloth.sides.ravel(), weights=np.repeat(cloth.areas, 3))
    return areas[np.searchsorted(cloth.edges @ key, np.sort(edges, axis=1) @ key)]


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


@dataclass
class NewtonSolver(Method):
    """Method of one solver of newton on a scene without contact.

    Sub-steps are those of newton's examples: a frame is not the minimum of one step of ours, and its
    energy gap says so. Pins move evenly over the sub-steps of a frame, as in the reference. Copies into
    and out of newton are on the clock.
    """

    solver: str
    iterations: int
    substeps: int

    def prepare(self, scene: BuiltScene) -> None:
        """Build the model and let it compile, by one frame that is thrown away."""
        self.scene = scene
        self.newton = NewtonCloth(scene.cloth, self.iterations, self.solver)
        self.newton.advance(scene.start, np.zeros_like(scene.start), scene.dt / self.substeps)

    def run(self) -> Trajectory:
        """Advance all frames; stop where a vertex is not finite or flew away."""
        import newton

        scene, pins = self.scene, self.scene.cloth.pins
        x, v = scene.start, scene.start_velocity
        positions, seconds, status, reason = [x], [0.0], "ok", ""
        clock = time.perf_counter()
        for frame in range(1, scene.frames):
            pinned = x[pins]
            target = pinned if scene.pin_positions is None else scene.pin_positions(frame)
            for j in range(1, self.substeps + 1):
                if scene.pin_positions is not None:
                    share = j / self.substeps
                    x = x.copy()
                    x[pins] = (1 - share) * pinned + share * target
                x, v = self.newton.advance(x, v, scene.dt / self.substeps)
            if not (np.isfinite(x).all() and np.abs(x).max() < FAR):
                status, reason = "diverged", f"frame {frame}: a vertex is nowhere, or {FAR:g} m away"
                break
            positions.append(x)
            before, clock = clock, time.perf_counter()
            seconds.append(clock - before)
        made_by = {"method": f"newton {newton.__version__} {self.solver}", "iterations": self.iterations}
        made_by["substeps"] = self.substeps
        return Trajectory(
            np.array(positions), scene.cloth.faces, scene.dt * np.arange(len(positions)), status=status,
            reason=reason, frame_seconds=np.array(seconds), provenance=made_by,
        )  # fmt: skip


def make(*, models: Path, seed: int, solver: str, iterations: int, substeps: int) -> NewtonSolver:
    """Make the solver "VBD" or "XPBD" of newton."""
    return NewtonSolver(solver, iterations, substeps)
