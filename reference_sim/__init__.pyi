from .cloth import Cloth as Cloth
from .cloth import MeshError as MeshError
from .material import GRAVITY as GRAVITY
from .material import Material as Material
from .minimise.minimisers import minimise as minimise
from .minimise.result import Result as Result
from .obstacle import Obstacle as Obstacle
from .potential import Potential as Potential
from .time_loop import simulate as simulate
from .trajectory import Trajectory as Trajectory
from .trajectory import TrajectoryError as TrajectoryError

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
    "minimise",
    "simulate",
]
