"""Engines: the reference, MuJoCo and newton on one cloth. Listing them imports no engine.

How the material becomes that of MuJoCo, a flex of dimension 2 with `elastic2d`:
    young, poisson, thickness    E, nu and t of the fabric: its membrane is StVK in plane stress, as here
    bending                      that of a shell of this thickness, E t^3 / (12 (1 - nu^2)) = 0.8 uN m: softer
                                 than SNUG's hinges, as MuJoCo takes no other
    masses                       lumped as here; a pinned vertex has no degree of freedom
    damping, contact             none
`integrator="Euler"` is MuJoCo's default and explicit in the elastic forces; "discrete" solves one linearised
implicit step. Positions are read from `qpos`: those of `flexvert_xpos` are a step old after `mj_step`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from engine_runs import Engine, EngineCloth
from newton_cloth import NewtonCloth
from reference_sim import GRAVITY, Cloth
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from reference_sim.time_step import State, TimeStepper


class ReferenceCloth(EngineCloth):
    """Cloth under the energies of the paper: backward Euler by Newton's method, so many iterations a step."""

    def __init__(self, cloth: Cloth, iterations: int) -> None:
        self.cloth = cloth
        self.energies = (StretchStVK(self.cloth), BendHinge(self.cloth))
        self.iterations = iterations
        self._steppers: dict[float, TimeStepper] = {}

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Take one step. Raises ValueError where it diverges."""
        if dt not in self._steppers:
            terms = [*self.energies, Gravity(self.cloth)]
            self._steppers[dt] = TimeStepper(
                self.cloth, terms, dt=dt, method="newton", max_iterations=self.iterations
            )
        after, (result,) = self._steppers[dt].advance(1, State(x, v), None)
        if after is None:
            raise ValueError(f"the reference diverged: {result.reason}")
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
    name="reference", title="Reference", licence="MIT", substeps=1, iterations=50,
    settings="one step a frame, minimised to 1e-6", factors=(1, 4), make=ReferenceCloth,
)  # fmt: skip

_EXAMPLE = "newton's example cloth_hanging"
_of_newton = partial(Engine, module="newton", licence="Apache-2.0", iterations=10)
_of_mujoco = partial(Engine, module="mujoco", licence="Apache-2.0", substeps=17, iterates=False)

ENGINES: tuple[Engine, ...] = (
    REFERENCE,
    _of_newton(
        name="newton.vbd", title="newton, VBD", substeps=20,
        settings=f"20 sub-steps of 10 iterations: {_EXAMPLE}",
        factors=(1, 4, 16, 64), make=partial(NewtonCloth, solver="VBD"),
    ),
    _of_newton(
        name="newton.vbd_frame", title="newton, VBD, one step a frame", substeps=1,
        settings="one step of 10 iterations: the solver's default",
        factors=(1, 4, 16, 64, 256, 1024), make=partial(NewtonCloth, solver="VBD"),
    ),
    _of_newton(
        name="newton.xpbd", title="newton, XPBD", substeps=20,
        settings=f"20 sub-steps of 10 iterations: {_EXAMPLE}",
        factors=(1, 4, 16, 64), make=partial(NewtonCloth, solver="XPBD"),
    ),
    _of_newton(
        name="newton.style3d", title="newton, Style3D", substeps=4,
        settings=f"4 sub-steps of 10 iterations: {_EXAMPLE}",
        factors=(1, 4, 16, 64), make=partial(NewtonCloth, solver="Style3D"),
    ),
    _of_mujoco(
        name="mujoco.euler", title="MuJoCo, Euler",
        settings="17 steps a frame, of 1.96 ms; the default is 2 ms and integrator Euler",
        factors=(1, 4, 16, 64, 256), make=partial(MujocoCloth, integrator="Euler"),
    ),
    _of_mujoco(
        name="mujoco.discrete", title="MuJoCo, discrete",
        settings="17 steps a frame, of 1.96 ms; integrator discrete, as its manual advises",
        factors=(1, 4, 16, 64), make=partial(MujocoCloth, integrator="discrete"),
    ),
)  # fmt: skip


def find_engine(name: str) -> Engine:
    """Return the declared engine of that name. Raises KeyError for a name that none has."""
    return {engine.name: engine for engine in ENGINES}[name]
