"""Engines: the visible tuple of declarations. Listing them imports no engine."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from benchmarks.engines.engine import ITERATIONS, SUBSTEPS, Engine, EngineCloth

if TYPE_CHECKING:
    from benchmarks.engines.specimens import Specimen

NEWTON_EXAMPLE = "newton's example cloth_hanging"
INSTALL = "pip install 'neural-garment-benchmark[engines]'"


def _reference(specimen: Specimen, iterations: int) -> EngineCloth:
    from benchmarks.engines.reference_cloth import ReferenceCloth

    return ReferenceCloth(specimen, iterations)


def _vbd(specimen: Specimen, iterations: int) -> EngineCloth:
    return _newton(specimen, "VBD", iterations)


def _xpbd(specimen: Specimen, iterations: int) -> EngineCloth:
    return _newton(specimen, "XPBD", iterations)


def _style3d(specimen: Specimen, iterations: int) -> EngineCloth:
    return _newton(specimen, "Style3D", iterations)


def _newton(specimen: Specimen, solver: str, iterations: int) -> EngineCloth:
    from benchmarks.engines.newton_cloth import NewtonCloth
    from benchmarks.engines.newton_energies import energies_of

    made = NewtonCloth(specimen.cloth, solver, iterations=iterations)
    made.energies = energies_of(solver, specimen.cloth)
    return made


def _mujoco_euler(specimen: Specimen, iterations: int) -> EngineCloth:
    from benchmarks.engines.mujoco_cloth import MujocoCloth

    return MujocoCloth(specimen, "Euler")


def _mujoco_discrete(specimen: Specimen, iterations: int) -> EngineCloth:
    from benchmarks.engines.mujoco_cloth import MujocoCloth

    return MujocoCloth(specimen, "discrete")


REFERENCE = Engine(
    name="reference", title="Reference", licence="MIT", substeps=1, iterations=50,
    settings="one step a frame, minimised to 1e-6", factors=(1, 4), make=_reference,
)  # fmt: skip

_of_newton = partial(Engine, module="newton", package="newton", licence="Apache-2.0", install=INSTALL)
_of_mujoco = partial(Engine, module="mujoco", package="mujoco", licence="Apache-2.0", install=INSTALL)

ENGINES: tuple[Engine, ...] = (
    REFERENCE,
    _of_newton(
        name="newton.vbd", title="newton, VBD", substeps=20, iterations=10, make=_vbd,
        settings=f"20 sub-steps of 10 iterations: {NEWTON_EXAMPLE}", grows=ITERATIONS,
        factors=(1, 4, 16, 64),
    ),
    _of_newton(
        name="newton.vbd_frame", title="newton, VBD, one step a frame", substeps=1, iterations=10,
        settings="one step of 10 iterations: the solver's default", make=_vbd, grows=ITERATIONS,
        factors=(1, 4, 16, 64, 256, 1024),
    ),
    _of_newton(
        name="newton.xpbd", title="newton, XPBD", substeps=20, iterations=10, make=_xpbd,
        settings=f"20 sub-steps of 10 iterations: {NEWTON_EXAMPLE}", grows=ITERATIONS,
        factors=(1, 4, 16, 64),
    ),
    _of_newton(
        name="newton.style3d", title="newton, Style3D", substeps=4, iterations=10, make=_style3d,
        settings=f"4 sub-steps of 10 iterations: {NEWTON_EXAMPLE}", grows=ITERATIONS, factors=(1, 4, 16, 64),
    ),
    _of_mujoco(
        name="mujoco.euler", title="MuJoCo, Euler", substeps=17, make=_mujoco_euler,
        settings="17 steps a frame, of 1.96 ms; the default is 2 ms and integrator Euler", grows=SUBSTEPS,
        factors=(1, 4, 16, 64, 256),
    ),
    _of_mujoco(
        name="mujoco.discrete", title="MuJoCo, discrete", substeps=17, make=_mujoco_discrete,
        settings="17 steps a frame, of 1.96 ms; integrator discrete, as its manual advises", grows=SUBSTEPS,
        factors=(1, 4, 16, 64),
    ),
)  # fmt: skip


def find_engine(name: str) -> Engine:
    """Return a declared engine.

    Raises:
        KeyError: no engine has that name.

    >>> find_engine("mujoco.euler").budget(4)
    (68, 1)
    """
    for engine in ENGINES:
        if engine.name == name:
            return engine
    raise KeyError(f"no engine {name!r}: use one of {', '.join(engine.name for engine in ENGINES)}")
