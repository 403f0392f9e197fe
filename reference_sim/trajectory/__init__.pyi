from .point_cache import read_point_cache as read_point_cache
from .point_cache import write_point_cache as write_point_cache
from .trajectory import Trajectory as Trajectory
from .trajectory import TrajectoryError as TrajectoryError
from .writer import TrajectoryWriter as TrajectoryWriter

__all__ = [
    "Trajectory",
    "TrajectoryError",
    "TrajectoryWriter",
    "read_point_cache",
    "write_point_cache",
]
