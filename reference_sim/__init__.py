"""The reference: cloth physics and its minimisers. It imports nothing else of this project.

`Obstacle` and the energies are imported when first used, so that a scene pays only for what it has.
"""

from typing import TYPE_CHECKING

from .cloth import Cloth, MeshError
from .material import GRAVITY, Material
from .minimise import Result, minimise
from .potential import Potential
from .simulator import simulate
from .trajectory import Trajectory, TrajectoryError
from .trajectory_writer import TrajectoryWriter

if TYPE_CHECKING:
    from .obstacle import Obstacle

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
    from .obstacle import Obstacle

    return Obstacle
