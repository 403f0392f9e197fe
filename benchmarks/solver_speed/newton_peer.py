"""One cloth in NVIDIA's newton: SolverVBD or SolverXPBD on the processor, in float32.

How our material becomes newton's (its units are SI; tri_ and edge_ parameters as its kernels use them):
    particle mass   our lumped mass; 0 at pins, which makes a particle kinematic
    gravity         (0, -9.81, 0) m/s^2
    tri_ke, tri_ka  mu, lambda of the membrane [N/m]                       VBD
    edge_ke         k / l0 [J/m], k / (A1 + A2) [J/m^2] per inner edge      VBD, XPBD
    spring_ke       E2 (A1 + A2) / l0^2 [N/m] per edge                     XPBD, which ignores triangles
    damping, drag, lift, particle radius, contacts: 0, none
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from reference_sim import Cloth
from reference_sim.material import GRAVITY

from .peer_energies import spring_stiffness


@dataclass(frozen=True)
class Advance:
    """Positions (V, 3) [m], velocities [m/s] at the end of a frame and before its last sub-step; seconds."""

    x: np.ndarray
    v: np.ndarray
    x_before: np.ndarray
    v_before: np.ndarray
    seconds: float

    @property
    def diverged(self) -> bool:
        """Whether a vertex is nowhere, or 100 m away."""
        return not (np.isfinite(self.x).all() and np.abs(self.x).max() < 100)


class Peer:
    """A solver of newton bound to one cloth.

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

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> Advance:
        """One frame of dt [s] from x (V, 3) [m] and v (V, 3) [m/s]; copying in and out is off the clock."""
        now, then = self._states
        now.particle_q.assign(x.astype(np.float32))
        now.particle_qd.assign(v.astype(np.float32))
        seconds = 0.0
        for substep in range(self.substeps):
            if substep == self.substeps - 1:
                x_before, v_before = _numbers(now)
            clock = time.perf_counter()
            self._solver.step(now, then, None, None, dt / self.substeps)
            seconds += time.perf_counter() - clock  # a launch on the processor returns when it is done
            now, then = then, now
        return Advance(*_numbers(now), x_before, v_before, seconds)


def _numbers(state: Any) -> tuple[np.ndarray, np.ndarray]:
    return state.particle_q.numpy().astype(np.float64), state.particle_qd.numpy().astype(np.float64)


def build_model(cloth: Cloth, solver: str) -> Any:
    """The newton.Model of `cloth` for "VBD" or "XPBD", with the parameters of the table above."""
    import newton
    import warp

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
    scale = np.array(builder.edge_rest_length) if solver == "VBD" else _two_areas(cloth, edges)
    stiffness = np.where((edges >= 0).all(axis=1), cloth.material.bending_stiffness / scale, 0.0)
    builder.edge_bending_properties[:] = [(float(ke), 0.0) for ke in stiffness]
    if solver == "XPBD":
        for (i, j), ke in zip(cloth.edges.tolist(), spring_stiffness(cloth)):
            builder.add_spring(i, j, float(ke), 0.0, control=0.0)
    else:
        builder.color(include_bending=True)
    return builder.finalize(device="cpu")


def _two_areas(cloth: Cloth, edges: np.ndarray) -> np.ndarray:
    """(E,) A1 + A2 [m^2] of newton's edges (opposite, opposite, start, end); 1 for a boundary edge."""
    x = cloth.rest_positions
    inner = (edges >= 0).all(axis=1)
    a, b, start, end = edges[inner].T
    e = x[end] - x[start]
    double = [np.linalg.norm(np.cross(e, x[tip] - x[start]), axis=1) for tip in (a, b)]
    areas = np.ones(len(edges))
    areas[inner] = 0.5 * (double[0] + double[1])
    return areas
