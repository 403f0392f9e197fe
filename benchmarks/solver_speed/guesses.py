"""How good the first guess of a step is: potential above the minimum that Newton finds from it."""

from __future__ import annotations

import numpy as np

from reference_sim import Potential
from reference_sim.energies import Inertia, Step
from reference_sim.minimise import Newton

from ..parts import Row
from .tshirt import dressed, walk

CASES = ("walk, 1000", "run, 1000")


def measure(case: str, repeats: int) -> list[Row]:
    """Mean over every fifth frame [J], and iterations from each guess; repeats change nothing here."""
    scene = dressed(case)
    assert scene.obstacle is not None
    x = walk(scene).positions
    potential = Potential([*scene.energies, Inertia(scene.cloth, scene.dt)])
    newton = Newton(potential)
    above: dict[str, list[float]] = {}
    iterations: dict[str, list[int]] = {}
    for frame in range(5, len(x), 5):
        previous, velocity = x[frame - 1], (x[frame - 1] - x[frame - 2]) / scene.dt
        guesses = {
            "previous": previous,
            "extrapolated": previous + scene.dt * velocity,
            "carried": scene.obstacle.transported(previous, frame, scene.cloth.rest_positions),
        }
        # Planes are taken at the guess that the simulator uses, so that all three minimise one potential.
        potential.prepare(Step(previous, velocity, guesses["carried"], scene.dt, scene.obstacle, frame))
        results = {name: newton.minimise(guess) for name, guess in guesses.items()}
        best = min(result.energy for result in results.values())
        for name, guess in guesses.items():
            above.setdefault(name, []).append(potential.value(guess) - best)
            iterations.setdefault(name, []).append(results[name].iterations)
    rows: list[Row] = []
    for name, values in above.items():
        rows.append((f"{name}: above the minimum", float(np.mean(values)), "J"))
        rows.append((f"{name}: iterations", float(np.mean(iterations[name])), ""))
    return rows
