"""How far a frame is from the minimum of its own time step, as a share of what had to be gained.

At frame t the step's objective is Phi(x) = inertia + all declared terms, with x_hat from the method's own
two previous frames and contact planes frozen at the step's initial guess x_0 (the same guess as the
simulator's: carried by the obstacle, else x + dt v). Over the sampled frames

    gap = sum (Phi(x_t) - Phi*) / sum (Phi(x_0) - Phi*)

so 0 is a minimiser and 1 is no better than the guess. Phi* is the lowest value found: Newton from x_0,
Newton from x_t, or x_t itself. Each method is judged from its own history, so a small gap says that a step
was solved, not that the past was right: it does not measure dynamics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .energy import FIRST_FULL_FRAME

if TYPE_CHECKING:
    from ..scene import BuiltScene

TIMEOUT = 20.0  # [s] for one minimisation


def relative_gap(scene: BuiltScene, positions: NDArray[np.float64], *, samples: int) -> float:
    """The gap [1] of positions (T,V,3) [m] over `samples` frames spread evenly; nan with too few frames."""
    from reference_sim import Potential
    from reference_sim.energies import Inertia, Step
    from reference_sim.minimise import Newton

    if len(positions) <= FIRST_FULL_FRAME:
        return float("nan")
    potential = Potential([*scene.energies, Inertia(scene.cloth, scene.dt)])
    newton = Newton(potential, timeout=TIMEOUT)
    frames = np.unique(np.linspace(FIRST_FULL_FRAME, len(positions) - 1, samples).round().astype(int))
    missed = gained = 0.0
    for frame in frames:
        x, previous = np.ascontiguousarray(positions[frame]), positions[frame - 1]
        velocity = (previous - positions[frame - 2]) / scene.dt
        guess = first_guess(scene, previous, velocity, int(frame))
        step = Step(previous, velocity, guess, scene.dt, scene.obstacle, int(frame))
        potential.prepare(step)
        here = potential.value(x)
        best = min(here, newton.minimise(guess).energy, newton.minimise(x).energy)
        missed += here - best
        gained += potential.value(guess) - best
    return missed / gained if gained > 0.0 else float("nan")


def first_guess(
    scene: BuiltScene, previous: NDArray[np.float64], velocity: NDArray[np.float64], frame: int
) -> NDArray[np.float64]:
    """Where a solver would start, (V,3) [m]: what a step costs nothing to get."""
    if scene.obstacle is None:
        guess = previous + scene.dt * velocity
    else:
        guess = scene.obstacle.carried(previous, frame, scene.cloth.rest_positions)
    guess[scene.cloth.pins] = previous[scene.cloth.pins]
    return np.ascontiguousarray(guess)
