"""Laws that an engine keeps whatever its energy: free fall, momentum, symmetry, reaction, own minimum.

Free fall. A step that adds g h to the velocity and moves by the new velocity, as backward Euler and
semi-implicit Euler do, has fallen g h^2 N (N + 1) / 2 after N steps; the continuous law is g t^2 / 2.
"""

from __future__ import annotations

import numpy as np

from benchmarks.engines.engine import FRAME
from benchmarks.engines.roll_outs import RollOut, Step
from benchmarks.engines.specimens import SPEED
from reference_sim.energies.energy import Energy
from reference_sim.energies.energy import Step as FrozenStep
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.inertia import Inertia
from reference_sim.material import GRAVITY
from reference_sim.minimise.newton import Newton
from reference_sim.potential import Potential

GAP_FRAMES = (9, 19, 29)  # whose last time steps are compared with their own minimum


def centre(run: RollOut) -> np.ndarray:
    """Return the centre of mass (T, 3) [m] of each frame."""
    masses = run.specimen.cloth.masses
    return np.einsum("v,tvc->tc", masses, run.positions) / masses.sum()


def fall_over_discrete_law(run: RollOut) -> float:
    """Return the fall of a free sheet over g h^2 N (N + 1) / 2, h the engine's time step."""
    steps = round((len(run.positions) - 1) * FRAME / run.step)
    return _fall(run) / (0.5 * GRAVITY * run.step**2 * steps * (steps + 1))


def fall_over_continuous_law(run: RollOut) -> float:
    """Return the fall of a free sheet over g t^2 / 2."""
    return _fall(run) / (0.5 * GRAVITY * ((len(run.positions) - 1) * FRAME) ** 2)


def _fall(run: RollOut) -> float:
    heights = centre(run)[:, 1]
    return float(heights[0] - heights[-1])


def momentum_error(run: RollOut) -> float:
    """Return how far the centre of a thrown sheet is from its horizontal path, over that path [%]."""
    way = np.delete(centre(run)[-1] - centre(run)[0], 1)
    path = np.array([SPEED * (len(run.positions) - 1) * FRAME, 0.0])
    return 100.0 * float(np.linalg.norm(way - path) / np.linalg.norm(path))


def spin_kept(run: RollOut) -> float:
    """Return the share of the angular momentum about the vertical that is left at the end [%]."""
    start = _spin(run, run.positions[0], run.specimen.velocity)
    return 100.0 * _spin(run, run.positions[-1], run.velocity) / start


def _spin(run: RollOut, x: np.ndarray, v: np.ndarray) -> float:
    m = run.specimen.cloth.masses
    arm, speed = (a - (m @ a) / m.sum() for a in (x, v))
    return float(m @ np.cross(arm, speed)[:, 1])


def asymmetry(run: RollOut) -> float:
    """Return the largest distance between a vertex and the mirror image of its counterpart [%].

    It is taken over all frames, and over the root mean square of the motion.
    """
    image = run.positions[:, run.specimen.mirrored] * [-1.0, 1.0, 1.0]
    worst = np.linalg.norm(run.positions - image, axis=2).max()
    return 100.0 * float(worst / motion(run))


def motion(run: RollOut) -> float:
    """Return the root mean square [m] of the way of all vertices from their start, over all frames."""
    return _rms(run.positions[1:] - run.positions[0])


def distance(run: RollOut, limit: RollOut) -> float:
    """Return the root mean square distance of two roll-outs over the motion of the second [%]."""
    return 100.0 * _rms(run.positions[1:] - limit.positions[1:]) / motion(limit)


def _rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.square(difference).sum(axis=2).mean()))


def reaction_over_weight(run: RollOut) -> float:
    """Return the force of the pins over weight and inertia, m (g + a), in the last second.

    The force is the gradient of the engine's documented energies at the pins, the pinned mass added, and a is
    the acceleration of the centre. Both are taken from the same time steps, the last of each frame, because
    the law is exact in every time step. Forces at the ends of frames over an acceleration from the centres of
    frames would be wrong by 1 or 2 % where the strip bounces: 30 samples a second do not average its force.

    Without energies the force is not known, and the number is 1 + a / g, with the a between the ends of the
    last second; it is 1 at rest.
    """
    cloth = run.specimen.cloth
    first = len(run.positions) // 3 * 2
    if not run.energies:
        speeds = np.diff(centre(run)[first - 1 :, 1]) / FRAME
        return 1.0 + float(speeds[-1] - speeds[0]) / (FRAME * (len(speeds) - 1)) / GRAVITY
    pulls, inertias = [], []
    for step in run.last_steps[first:]:
        x = step.x if run.explicit else step.after
        pulls.append(sum(energy.value_and_gradient(x)[1][cloth.pins, 1].sum() for energy in run.energies))
        acceleration = (step.after - step.x - run.step * step.v)[:, 1] / run.step**2
        inertias.append(cloth.masses @ (GRAVITY + acceleration))
    pinned = GRAVITY * cloth.masses[cloth.pins].sum()
    return float((np.mean(pulls) + pinned) / np.mean(inertias))


def energy_gap(run: RollOut) -> float | None:
    """Return what the engine leaves of the decrease of its own incremental potential, in some steps [%].

    0 is the minimum, found by Newton's method from the same state; 100 is the inertial guess x + h v. None
    where energies are not documented.

    Raises:
        RuntimeError: Newton's method did not converge in one of these steps.
    """
    if not run.energies:
        return None
    return float(np.mean([_gap(run.last_steps[frame], run) for frame in GAP_FRAMES]))


def _gap(step: Step, run: RollOut) -> float:
    cloth = run.specimen.cloth
    terms: list[Energy] = [*run.energies, Gravity(cloth), Inertia(cloth, run.step)]
    potential = Potential(terms)
    guess = step.x + run.step * step.v
    guess[cloth.pins] = step.x[cloth.pins]
    potential.prepare(FrozenStep(step.x, step.v, guess, run.step))
    minimum = Newton(potential, max_iterations=200).minimise(guess)
    if minimum.status != "converged":
        raise RuntimeError(
            f"energy gap: the minimum of a step is not known: {minimum.status}, {minimum.reason}"
        )
    least = minimum.energy
    return 100.0 * (potential.value(step.after) - least) / (potential.value(guess) - least)
