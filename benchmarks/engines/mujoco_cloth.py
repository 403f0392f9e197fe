"""Cloth of MuJoCo: a flex of dimension 2 with `elastic2d`.

How the material becomes MuJoCo's:
    young, poisson, thickness    E, nu and t of the fabric: its membrane is StVK in plane stress, as here
    bending                      that of a shell of this thickness, E t^3 / (12 (1 - nu^2)) = 0.8 uN m: softer
                                 than SNUG's hinges, as MuJoCo takes no other
    masses                       lumped as here; a pinned vertex has no degree of freedom
    damping, contact             none
`integrator="Euler"` is MuJoCo's default and explicit in the elastic forces; "discrete" solves one linearised
implicit step. Positions are read from `qpos`: those of `flexvert_xpos` are a step old after `mj_step`.
"""

from __future__ import annotations

import numpy as np

from benchmarks.engines.engine import EngineCloth
from benchmarks.engines.specimens import Specimen
from reference_sim.cloth import Cloth
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import GRAVITY


class MujocoCloth(EngineCloth):
    """Specimen as a flex. integrator: of MuJoCo. Raises ImportError where mujoco is not installed."""

    def __init__(self, specimen: Specimen, integrator: str) -> None:
        import mujoco

        self._step = mujoco.mj_step
        cloth = specimen.cloth
        self.model = mujoco.MjModel.from_xml_string(model_xml(cloth, integrator))
        self.energies = (StretchStVK(cloth),)
        self.explicit = integrator == "Euler"
        self.rest = cloth.rest_positions
        self.free = np.setdiff1d(np.arange(cloth.vertex_count), cloth.pins)
        bodies = self.model.flex_vertbodyid[self.free]
        self.model.body_mass[bodies] = cloth.masses[self.free]
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        self._first = self.model.body_dofadr[bodies]  # three slides a vertex: dof and qpos count alike
        self.data = mujoco.MjData(self.model)

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Take one step; the state is copied into MuJoCo and out of it."""
        places = self._first[:, None] + np.arange(3)
        self.model.opt.timestep = dt
        self.data.qpos[places] = (x - self.rest)[self.free]
        self.data.qvel[places] = v[self.free]
        self._step(self.model, self.data)
        x, v = x.copy(), np.zeros_like(v)
        x[self.free] = self.rest[self.free] + self.data.qpos[places]
        v[self.free] = self.data.qvel[places]
        return x, v


def model_xml(cloth: Cloth, integrator: str) -> str:
    """Return the MJCF of `cloth`, with the parameters of the table above."""
    material = cloth.material
    points = " ".join(f"{value:.9g}" for value in cloth.rest_positions.ravel())
    elements = " ".join(map(str, cloth.faces.ravel()))
    pins = f'<pin id="{" ".join(map(str, cloth.pins))}"/>' if len(cloth.pins) else ""
    return f"""<mujoco><option gravity="0 {-GRAVITY} 0" integrator="{integrator}"/><worldbody>
<flexcomp name="cloth" type="direct" dim="2" point="{points}" element="{elements}" radius="0.001"
  mass="{cloth.masses.sum()}">
<elasticity young="{material.young_modulus}" poisson="{material.poisson_ratio}"
  thickness="{material.thickness}" elastic2d="both"/>
<contact contype="0" conaffinity="0" selfcollide="none"/>{pins}
</flexcomp></worldbody></mujoco>"""
