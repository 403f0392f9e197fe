"""Engines: the reference, MuJoCo and newton on one cloth. Listing them imports no engine.

How the material becomes that of MuJoCo, a flex of dimension 2 with `elastic2d`:
    young, poisson, thickness    E, nu and t of the fabric: its membrane is StVK in plane stress, as here
    bending                      that of a shell of this thickness, E t^3 / (12 (1 - nu^2)) = 0.8 uN m:
                                 softer than SNUG's hinges, as MuJoCo takes no other
    masses                       lumped as here; a pinned vertex has no degree of freedom
    damping, contact             none
`integrator="Euler"` is MuJoCo's default and explicit in the elastic forces; "discrete" solves one
linearised implicit step. Positions are read from `qpos`: those of `flexvert_xpos` are a step old after
`mj_step`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from engine_runs import Engine, EngineCloth, EngineDiverged
from newton_cloth import NewtonCloth
from reference_sim import GRAVITY, Cloth
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from reference_sim.time_loop import State, TimeStepper


class ReferenceCloth(EngineCloth):
    """Cloth under the energies of the paper: backward Euler by Newton's method, so many iterations a step."""

    def __init__(self, cloth: Cloth, iterations: int) -> None:
        self.cloth = cloth
        self.energies = (StretchStVK(self.cloth), BendHinge(self.cloth))
        self.iterations = iterations
        self._steppers: dict[float, TimeStepper] = {}

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Take one step. Raises EngineDiverged."""
        if dt not in self._steppers:
            terms = [*self.energies, Gravity(self.cloth)]
            self._steppers[dt] = TimeStepper(
                self.cloth, terms, dt=dt, method="newton", max_iterations=self.iterations
            )
        after, (result,) = self._steppers[dt].advance(1, State(x, v), None)
        if after is None:
            raise EngineDiverged(f"the reference diverged: {result.reason}")
        return after.x, after.v


class MujocoCloth(EngineCloth):
    """Cloth as a flex, whose steps do not iterate. Raises ImportError where mujoco is not installed."""

    def __init__(self, cloth: Cloth, iterations: int, *, integrator: str) -> None:
        import mujoco

        self._step = mujoco.mj_step
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


REFERENCE = Engine(
    name="reference", title="Reference", substeps=1, iterations=50,
    settings="one step a frame, minimised to 1e-6", factors=(1, 4), make=ReferenceCloth,
)  # fmt: skip


def _newton(name: str, title: str, solver: str, substeps: int, **declared: Any) -> Engine:
    settings = f"{substeps} sub-steps of 10 iterations: newton's example cloth_hanging"
    return Engine(
        name=f"newton.{name}", title=f"newton, {title}", module="newton", iterations=10,
        substeps=substeps, make=partial(NewtonCloth, solver=solver), **{"settings": settings, **declared},
    )  # fmt: skip


def _mujoco(integrator: str, settings: str, **declared: Any) -> Engine:
    return Engine(
        name=f"mujoco.{integrator.lower()}", title=f"MuJoCo, {integrator}", module="mujoco", substeps=17,
        iterates=False, settings=f"17 steps a frame, of 1.96 ms; {settings}",
        make=partial(MujocoCloth, integrator=integrator), **declared,
    )  # fmt: skip


ENGINES: dict[str, Engine] = {engine.name: engine for engine in (
    REFERENCE,
    _newton("vbd", "VBD", "VBD", 20),
    _newton("vbd_frame", "VBD, one step a frame", "VBD", 1, factors=(1, 4, 16, 64, 256, 1024),
            settings="one step of 10 iterations: the solver's default"),
    _newton("xpbd", "XPBD", "XPBD", 20),
    _newton("style3d", "Style3D", "Style3D", 4),
    _mujoco("Euler", "the default is 2 ms and integrator Euler", factors=(1, 4, 16, 64, 256)),
    _mujoco("discrete", "integrator discrete, as its manual advises"),
)}  # fmt: skip
