"""Energy of every declared term at every frame of a trajectory, by the very terms that were minimised.

Each method is judged on its own history: inertia compares a frame with the two before it in the same
trajectory, and contact planes are searched at the method's own positions. A frame before the third has no
two before it; it counts as moving freely, hence inertia 0 there, and means start at the third frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ..scene import BuiltScene

FIRST_FULL_FRAME = 2


def energy_series(scene: BuiltScene, positions: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Term -> (T,) [J] for positions (T,V,3) [m], plus "total". Terms not declared have no entry."""
    from reference_sim.energies import Inertia, Step

    terms = [*scene.energies, *([Inertia(scene.cloth, scene.dt)] if scene.dynamic else [])]
    series = {term.name: np.zeros(len(positions)) for term in terms}
    for frame, x in enumerate(positions):
        previous = positions[max(frame - 1, 0)]
        before = positions[max(frame - 2, 0)]
        step = Step(
            previous=previous,
            velocity=(previous - before) / scene.dt,
            guess=x,
            dt=scene.dt,
            obstacle=scene.obstacle,
            frame=frame,
        )
        for term in terms:
            if term.name == "inertia" and frame < FIRST_FULL_FRAME:
                continue
            term.prepare(step)
            series[term.name][frame] = term.value_and_gradient(np.ascontiguousarray(x))[0]
    if scene.origin_heights is not None:
        for term in scene.energies:
            if term.name == "gravity":
                series["gravity"] -= term.weights.sum() * (scene.origin_heights - term.origin_height)
    series["total"] = np.sum(list(series.values()), axis=0)
    return series


def mean_energy(series: NDArray[np.float64]) -> float:
    """Mean over the frames that have two before them [J per frame]; over all, where there are only two."""
    return float(series[FIRST_FULL_FRAME:].mean() if len(series) > FIRST_FULL_FRAME else series.mean())
