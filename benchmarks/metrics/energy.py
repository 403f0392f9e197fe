"""Energy of every declared term at every frame of a trajectory, by the very terms that were minimised.

Each method is judged on its own history: inertia compares a frame with the two before it in the same
trajectory, and contact planes are searched at the method's own positions. A frame before the third has no
two before it; it counts as moving freely, hence inertia 0 there. Means are over the frames after the warm-up.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reference_sim.energies.gravity import Gravity

from ..metric import Metric
from .step import own_terms

if TYPE_CHECKING:
    from reference_sim.energies import Energy

    from ..metric import RollOut, SceneRollOuts
    from ..scene import BuiltScene

FIRST_FULL_FRAME = 2


def _energy(term: str, definition: str, title: str = "") -> Metric:
    return Metric(
        name=f"energy/{term}", unit="J", title=title or term.capitalize(), definition=definition,
        table="energies", lower_is_better=True,
    )  # fmt: skip


METRICS = (
    _energy("strain", "membrane energy of the declared material, mean over frames"),
    _energy("bending", "energy of the hinges, mean over frames"),
    _energy("gravity", "weight times height above the pelvis's own height at rest, mean over frames"),
    _energy("inertia", "sum of m / (2 dt^2) |x - 2 x' + x''|^2 over vertices, x' and x'' the method's "
            "own last two frames; mean over frames"),
    _energy("collision", "cubic penalty of vertices, edge midpoints and centroids nearer to the body than "
            "the margin, contact planes searched at the method's own positions; mean over frames"),
    _energy("total", "sum of all terms that the scene declares, and inertia"),
    _energy("*", "energy of that term, mean over frames", "{}"),
)  # fmt: skip


def energy_series(
    scene: BuiltScene, trajectories: Sequence[NDArray[np.float64]]
) -> list[dict[str, NDArray[np.float64]]]:
    """Of each trajectory (T,V,3) [m]: term -> (T,) [J], plus "total". Terms not declared have no entry.

    Frames are the outer loop: what belongs to a frame alone, as an obstacle's search tree, is made once.
    """
    own = [own_terms(scene) for _ in trajectories]
    found = [{name: np.zeros(len(positions)) for name in scene.terms} for positions in trajectories]
    for frame in range(max(map(len, trajectories), default=0)):
        for positions, terms, series in zip(trajectories, own, found):
            if frame < len(positions):
                for name, value in _terms_at(scene, terms, positions, frame).items():
                    series[name][frame] = value
    for series in found:
        series["total"] = np.sum(list(series.values()), axis=0)
    return found


def _terms_at(
    scene: BuiltScene, terms: Sequence[Energy], positions: NDArray[np.float64], frame: int
) -> dict[str, float]:
    from reference_sim.energies import Step

    x = np.ascontiguousarray(positions[frame])
    previous, before = positions[max(frame - 1, 0)], positions[max(frame - 2, 0)]
    step = Step(
        previous=previous,
        velocity=(previous - before) / scene.dt,
        guess=x,
        dt=scene.dt,
        obstacle=scene.obstacle,
        frame=frame,
    )
    values = {}
    for term in terms:
        if term.name == "inertia" and frame < FIRST_FULL_FRAME:
            continue
        term.prepare(step)
        values[term.name] = term.value_and_gradient(x)[0]
        if term.name == "gravity" and scene.origin_heights is not None:
            assert isinstance(term, Gravity)
            values["gravity"] -= term.weights.sum() * (scene.origin_heights[frame] - term.origin_height)
    return values


def measure(roll_out: RollOut) -> dict[str, float]:
    """Means over the judged frames [J per frame]."""
    found = energies(roll_out)
    return {f"energy/{term}": float(series[roll_out.judged].mean()) for term, series in found.items()}


def series(roll_out: RollOut) -> dict[str, NDArray[np.float64]]:
    return {f"energy/{term}": series for term, series in energies(roll_out).items()}


def energies(roll_out: RollOut) -> dict[str, NDArray[np.float64]]:
    """Term -> (T,) [J], and "total"; of all roll-outs of the scene at once."""
    return roll_out.group.kept(_of_all)[roll_out.place]


def _of_all(group: SceneRollOuts) -> list[dict[str, NDArray[np.float64]]]:
    return energy_series(group.scene, group.positions)
