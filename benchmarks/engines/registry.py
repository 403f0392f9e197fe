"""Engines: the visible tuple of declarations. Listing them imports no engine."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from benchmarks.engines.engine import SUBSTEPS, Engine, EngineCloth

if TYPE_CHECKING:
    from benchmarks.engines.specimens import Specimen

NEWTON_EXAMPLE = "newton's example cloth_hanging"
INSTALL = "pip install 'neural-garment-benchmark[engines]'"


def _reference(specimen: Specimen, iterations: int) -> EngineCloth:
    from benchmarks.engines.reference_cloth import ReferenceCloth

    return ReferenceCloth(specimen, iterations)


def _newton(specimen: Specimen, iterations: int, *, solver: str) -> EngineCloth:
    from benchmarks.engines.newton_cloth import NewtonCloth
    from benchmarks.engines.newton_energies import energies_of

    made = NewtonCloth(specimen.cloth, solver, iterations=iterations)
    made.energies = energies_of(solver, specimen.cloth)
    return made


def _mujoco(specimen: Specimen, iterations: int, *, integrator: str) -> EngineCloth:
    from benchmarks.engines.mujoco_cloth import MujocoCloth

    return MujocoCloth(specimen, integrator)


REFERENCE = Engine(
    name="reference", title="Reference", licence="MIT", substeps=1, iterations=50,
    settings="one step a frame, minimised to 1e-6", factors=(1, 4), make=_reference,
)  # fmt: skip

_of_newton = partial(Engine, module="newton", licence="Apache-2.0", install=INSTALL)
_of_mujoco = partial(Engine, module="mujoco", licence="Apache-2.0", install=INSTALL)

ENGINES: tuple[Engine, ...] = (
    REFERENCE,
    _of_newton(
        name="newton.vbd", title="newton, VBD", substeps=20, iterations=10,
        settings=f"20 sub-steps of 10 iterations: {NEWTON_EXAMPLE}",
        factors=(1, 4, 16, 64), make=partial(_newton, solver="VBD"),
    ),
    _of_newton(
        name="newton.vbd_frame", title="newton, VBD, one step a frame", substeps=1, iterations=10,
        settings="one step of 10 iterations: the solver's default",
        factors=(1, 4, 16, 64, 256, 1024), make=partial(_newton, solver="VBD"),
    ),
    _of_newton(
        name="newton.xpbd", title="newton, XPBD", substeps=20, iterations=10,
        settings=f"20 sub-steps of 10 iterations: {NEWTON_EXAMPLE}",
        factors=(1, 4, 16, 64), make=partial(_newton, solver="XPBD"),
    ),
    _of_newton(
        name="newton.style3d", title="newton, Style3D", substeps=4, iterations=10,
        settings=f"4 sub-steps of 10 iterations: {NEWTON_EXAMPLE}",
        factors=(1, 4, 16, 64), make=partial(_newton, solver="Style3D"),
    ),
    _of_mujoco(
        name="mujoco.euler", title="MuJoCo, Euler", substeps=17, grows=SUBSTEPS,
        settings="17 steps a frame, of 1.96 ms; the default is 2 ms and integrator Euler",
        factors=(1, 4, 16, 64, 256), make=partial(_mujoco, integrator="Euler"),
    ),
    _of_mujoco(
        name="mujoco.discrete", title="MuJoCo, discrete", substeps=17, grows=SUBSTEPS,
        settings="17 steps a frame, of 1.96 ms; integrator discrete, as its manual advises",
        factors=(1, 4, 16, 64), make=partial(_mujoco, integrator="discrete"),
    ),
)  # fmt: skip


def find_engine(name: str) -> Engine:
    """Return the declared engine of that name. Raises KeyError for a name that none has.

    >>> find_engine("mujoco.euler").budget(4)
    (68, 1)
    """
    return {engine.name: engine for engine in ENGINES}[name]
