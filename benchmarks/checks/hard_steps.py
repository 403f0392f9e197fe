"""One time step each, in a state that breaks solvers. All start from a sheet of 0.4 m with 81 vertices."""

from __future__ import annotations

import dataclasses

import numpy as np

from reference_sim import Cloth, Material, Obstacle, Potential
from reference_sim.energies import BendHinge, ContactPenalty, Energy, Gravity, Inertia, Step, StretchStVK
from reference_sim.material import GRAVITY

from ..scenes.sheet import square_sheet
from ..scenes.sheet_on_sphere import sphere
from ..suites.extremes import HardStep

CELLS, SIZE, DT = 8, 0.4, 1.0 / 30.0
NOISE = 0.002  # [m]


def stiffness_up() -> HardStep:
    """E x 1000 from a noisy start: membrane forces of 1e4 vertex weights."""
    return _step(_cloth(young_modulus=70e6), _noisy)


def stiffness_down() -> HardStep:
    """E / 1000: the sheet can hardly carry itself."""
    return _step(_cloth(young_modulus=70.0), _noisy)


def long_step() -> HardStep:
    """dt = 1 s: next to nothing is left of inertia."""
    return _step(_cloth(), _noisy, dt=1.0)


def heavy() -> HardStep:
    """1000 g: stretches of several hundred percent."""
    return _step(_cloth(), _noisy, gravity=1000 * GRAVITY)


def random_start() -> HardStep:
    """Each vertex anywhere: inverted, crossing, stretched twentyfold."""
    return _step(_cloth(), lambda rest, random: random.uniform(-SIZE / 2, SIZE / 2, rest.shape))


def compressed() -> HardStep:
    """30 % of the width. A perfectly flat sheet would be a saddle by symmetry: a micrometre breaks it."""
    return _step(_cloth(), lambda rest, random: rest * [0.3, 1.0, 1.0] + random.normal(0, 1e-6, rest.shape))


def one_point() -> HardStep:
    """F = 0 everywhere: the membrane's force is zero there, its Hessian negative definite.

    The hinge angle has no value on a collapsed triangle, so bending is not declared. Nothing is pinned.
    """
    cloth = _cloth(pins=())
    return _step(cloth, lambda rest, random: np.zeros_like(rest), bending=False, still=True)


def teleport() -> HardStep:
    """A sphere of 8 cm stands at once where the sheet rests: vertices start up to 8 cm deep."""
    cloth = _cloth()
    points, faces = sphere(0.08, 12)
    obstacle = Obstacle(points + np.array([0.003, -0.02, 0.002]), faces)
    return _step(cloth, _noisy, obstacle=obstacle)


def _cloth(*, pins: tuple[int, ...] = (0, CELLS), **material: float) -> Cloth:
    positions, faces = square_sheet(CELLS, SIZE)
    return Cloth(positions, faces, dataclasses.replace(Material(), **material), pins=pins)


def _noisy(rest: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return rest + random.normal(0, NOISE, rest.shape)


def _step(
    cloth: Cloth,
    make_start,
    *,
    dt: float = DT,
    gravity: float = GRAVITY,
    bending: bool = True,
    still: bool = False,
    obstacle: Obstacle | None = None,
) -> HardStep:
    """The step from make_start(rest, random) with velocities of 1 m/s, started at the previous positions."""
    random = np.random.default_rng(11)
    x = make_start(cloth.rest_positions, random)
    x[cloth.pins] = cloth.rest_positions[cloth.pins]
    v = np.zeros_like(x) if still else random.normal(0, 1.0, x.shape)
    v[cloth.pins] = 0.0
    energies: list[Energy] = [StretchStVK(cloth), Gravity(cloth, acceleration=gravity), Inertia(cloth, dt)]
    if bending:
        energies.insert(1, BendHinge(cloth))
    if obstacle is not None:
        energies.insert(-1, ContactPenalty(cloth))
    potential = Potential(energies)
    potential.prepare(Step(previous=x, velocity=v, guess=x, dt=dt, obstacle=obstacle, frame=0))
    return HardStep(potential, x, np.asarray(cloth.pins), float(cloth.masses.mean() * GRAVITY))
