"""Vertex block descent and XPBD of NVIDIA's newton: other solvers on their own energies, in float32.

How our material becomes newton's (its units are SI; tri_ and edge_ parameters as its kernels use them):
    particle mass   our lumped mass; 0 at pins, which makes a particle kinematic
    gravity         (0, -9.81, 0) m/s^2
    tri_ke, tri_ka  mu, lambda of the membrane [N/m]                       VBD
    edge_ke         k s / l0 [J/m], k s / (A1 + A2) [J/m^2] per inner edge  VBD, XPBD
    spring_ke       E2 (A1 + A2) / l0^2 [N/m] per edge                     XPBD, which ignores triangles
    damping, drag, lift, particle radius, contacts: 0, none
with s = l0^2 / (4 (A1 + A2)). So VBD's membrane is stable Neo-Hookean, close to ours at small strain and not
at large, and XPBD has springs.
Sub-steps are those of newton's examples: a frame is not the minimum of one step of ours, and its energy gap
says so. Copies into and out of newton are on the clock.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.method import Method
from benchmarks.scene import BuiltScene
from reference_sim.cloth import Cloth
from reference_sim.material import GRAVITY
from reference_sim.trajectory.trajectory import Trajectory

FAR = 100.0  # [m] from the origin, where a vertex has flown away


class NewtonCloth:
    """Solver of newton bound to one cloth.

    Args:
        solver: "VBD" or "XPBD".
        iterations: of the solver in each sub-step.
        substeps: equal parts of a frame, as newton's own examples use them.

    Raises:
        ImportError: newton is not installed.
    """

    def __init__(self, cloth: Cloth, solver: str, *, iterations: int, substeps: int = 1) -> None:
        import warp

        warp.config.log_level = warp.LOG_ERROR
        import newton

        self.model = build_model(cloth, solver)
        make = {"VBD": newton.solvers.SolverVBD, "XPBD": newton.solvers.SolverXPBD}[solver]
        self._solver = make(self.model, iterations=iterations)
        self._states = self.model.state(), self.model.state()
        self.substeps = substeps

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (V, 3) [m] and velocities [m/s] a frame of dt [s] after x and v, in float64."""
        now, then = self._states
        now.particle_q.assign(x.astype(np.float32))
        now.particle_qd.assign(v.astype(np.float32))
        for _ in range(self.substeps):
            self._solver.step(now, then, None, None, dt / self.substeps)
            now, then = then, now
        return now.particle_q.numpy().astype(np.float64), now.particle_qd.numpy().astype(np.float64)


@dataclass
class NewtonSolver(Method):
    """Method of one solver of newton on a scene without contact."""

    solver: str
    iterations: int
    substeps: int

    def prepare(self, scene: BuiltScene) -> None:
        """Build the model and let it compile, by one frame that is thrown away."""
        self.scene = scene
        counts = {"iterations": self.iterations, "substeps": self.substeps}
        self.newton = NewtonCloth(scene.cloth, self.solver, **counts)
        self.newton.advance(scene.start, np.zeros_like(scene.start), scene.dt)

    def run(self) -> Trajectory:
        """Advance all frames; stop where a vertex is not finite or flew away."""
        scene = self.scene
        x = scene.start
        v = scene.start_velocity
        positions, seconds, status, reason = [x], [0.0], "ok", ""
        clock = time.perf_counter()
        for frame in range(1, scene.frames):
            if scene.pin_positions is not None:
                x = x.copy()
                x[scene.cloth.pins] = scene.pin_positions(frame)
            x, v = self.newton.advance(x, v, scene.dt)
            if not (np.isfinite(x).all() and np.abs(x).max() < FAR):
                status, reason = "diverged", f"frame {frame}: a vertex is nowhere, or 100 m away"
                break
            positions.append(x)
            before, clock = clock, time.perf_counter()
            seconds.append(clock - before)
        return Trajectory(
            positions=np.array(positions),
            faces=scene.cloth.faces,
            times=scene.dt * np.arange(len(positions)),
            frame_seconds=np.array(seconds),
            status=status,
            reason=reason,
            provenance=self._provenance(),
            frame_fields={},
        )

    def _provenance(self) -> dict[str, Any]:
        import newton

        return {
            "method": f"newton {newton.__version__} {self.solver}",
            "iterations": self.iterations,
            "substeps": self.substeps,
        }


def build_model(cloth: Cloth, solver: str) -> Any:
    """Build the newton.Model of `cloth` for "VBD" or "XPBD", with the parameters of the table above."""
    import newton
    import warp

    if cloth.rest_uv is not None:
        raise ValueError("newton takes the rest shape from positions in space: this cloth's is a UV chart")
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -GRAVITY, 0.0))
    builder.add_cloth_mesh(
        pos=warp.vec3(0.0, 0.0, 0.0),
        rot=warp.quat_identity(),
        scale=1.0,
        vel=warp.vec3(0.0, 0.0, 0.0),
        vertices=cloth.rest_positions.tolist(),
        indices=cloth.faces.ravel().tolist(),
        density=cloth.material.areal_density,
        tri_ke=cloth.material.lame_mu,
        tri_ka=cloth.material.lame_lambda,
        tri_kd=0.0,
        tri_drag=0.0,
        tri_lift=0.0,
        edge_ke=0.0,
        edge_kd=0.0,
        particle_radius=0.0,
    )
    builder.particle_mass[:] = cloth.masses.tolist()
    for pin in cloth.pins:
        builder.particle_mass[pin] = 0.0
    edges = np.array(builder.edge_indices)
    rest_angle = builder.edge_rest_angle
    rest_angle[:] = [0.0] * len(rest_angle)  # what BendHinge takes by default
    length, areas = np.array(builder.edge_rest_length), _two_areas(cloth, edges)
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


def _two_areas(cloth: Cloth, edges: np.ndarray) -> np.ndarray:
    """Return A1 + A2 (E,) [m^2] of newton's edges (opposite, opposite, start, end); 1 for a boundary edge."""
    x = cloth.rest_positions
    inner = (edges >= 0).all(axis=1)
    a, b, start, end = edges[inner].T
    e = x[end] - x[start]
    double = [np.linalg.norm(np.cross(e, x[tip] - x[start]), axis=1) for tip in (a, b)]
    areas = np.ones(len(edges))
    areas[inner] = 0.5 * (double[0] + double[1])
    return areas


def spring_stiffness(cloth: Cloth) -> np.ndarray:
    """Return E2 (A1 + A2)/l0^2 (E,) [N/m] of `cloth.edges`, near an isotropic sheet of modulus E2.

    The area-weighted springs of Van Gelder (1998). They cannot have our Poisson ratio.
    """
    n = cloth.vertex_count
    corners = np.sort(
        np.stack([cloth.faces, np.roll(cloth.faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1
    )
    edges = np.sort(cloth.edges, axis=1)
    key = edges[:, 0] * n + edges[:, 1]
    order = np.argsort(key)
    place = order[np.searchsorted(key[order], corners[:, 0] * n + corners[:, 1])]
    area = np.bincount(place, weights=np.repeat(cloth.areas, 3), minlength=len(edges))
    return cloth.material.membrane_modulus * area / cloth.edge_lengths**2


def make(*, models: Path, seed: int, solver: str, iterations: int, substeps: int) -> NewtonSolver:
    """Make the solver "VBD" or "XPBD" of newton."""
    return NewtonSolver(solver, iterations, substeps)
