"""Cloth of NVIDIA's newton: vertex block descent, XPBD and Style3D, in float32.

How our material becomes newton's (its units are SI; tri_ and edge_ parameters as its kernels use them):
    particle mass   our lumped mass; 0 at pins, which makes a particle kinematic
    gravity         (0, -9.81, 0) m/s^2
    tri_ke, tri_ka  mu, lambda of the membrane [N/m]                       VBD
    edge_ke         k s / l0 [J/m], k s / (A1 + A2) [J/m^2] per inner edge  VBD, XPBD
    spring_ke       E2 (A1 + A2) / l0^2 [N/m] per edge                     XPBD, which ignores triangles
    tri_aniso_ke    E2, E2, mu [N/m]: no Poisson effect                    Style3D
    edge_aniso_ke   k / 12 [J]: 3 l0^2 / (A1 + A2) of it is k s            Style3D
    damping, drag, lift, particle radius, contacts: 0, none
with s = l0^2 / (4 (A1 + A2)). So VBD's membrane is stable Neo-Hookean, close to ours at small strain and not
at large, XPBD has springs, and Style3D stretches the two axes apart from each other.
newton_energies.py has the energies of VBD and XPBD. Style3D's shear force is not the gradient of an energy.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.engines.engine import EngineCloth
from reference_sim.cloth import Cloth
from reference_sim.material import GRAVITY


class NewtonCloth(EngineCloth):
    """Solver of newton bound to one cloth.

    Args:
        solver: "VBD", "XPBD" or "Style3D".
        iterations: of the solver in each time step.

    Raises:
        ImportError: newton is not installed.
    """

    def __init__(self, cloth: Cloth, solver: str, *, iterations: int) -> None:
        import warp

        warp.config.log_level = warp.LOG_ERROR
        import newton

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
    import warp

    if cloth.rest_uv is not None:
        raise ValueError("newton takes the rest shape from positions in space: this cloth's is a UV chart")
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -GRAVITY, 0.0))
    if solver == "Style3D":
        _add_style3d(builder, cloth)
        return builder.finalize(device="cpu")
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
        builder,
        pos=warp.vec3(0.0, 0.0, 0.0),
        rot=warp.quat_identity(),
        vel=warp.vec3(0.0, 0.0, 0.0),
        vertices=x.tolist(),
        indices=cloth.faces.ravel().tolist(),
        panel_verts=panel.tolist(),
        density=material.areal_density,
        tri_aniso_ke=warp.vec3(tension, tension, material.lame_mu),
        edge_aniso_ke=warp.vec3(bending, bending, bending),
        tri_drag=0.0,
        tri_lift=0.0,
        particle_radius=0.0,
    )
    _set_masses(builder, cloth)


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
