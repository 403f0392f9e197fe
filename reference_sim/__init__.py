"""The reference: cloth physics and its minimisers. It imports nothing else of this project.

`Obstacle` and the energies are imported when first used, so that a scene pays only for what it has.
"""

from typing import TYPE_CHECKING

from reference_sim.cloth import Cloth, MeshError
from reference_sim.material import GRAVITY, Material
from reference_sim.minimise import Result, minimise
from reference_sim.potential import Potential
from reference_sim.time_loop import simulate
from reference_sim.trajectory.trajectory import Trajectory, TrajectoryError
from reference_sim.trajectory.writer import TrajectoryWriter

if TYPE_CHECKING:
    from reference_sim.obstacle import Obstacle

__all__ = [
    "GRAVITY",
    "Cloth",
    "Material",
    "MeshError",
    "Obstacle",
    "Potential",
    "Result",
    "Trajectory",
    "TrajectoryError",
    "TrajectoryWriter",
    "minimise",
    "simulate",
]


def __getattr__(name: str) -> type:
    if name != "Obstacle":
        raise AttributeError(f"module 'reference_sim' has no attribute {name!r}")
    from reference_sim.obstacle import Obstacle

    return Obstacle
