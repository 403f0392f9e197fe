from .point_cache import read_point_cache as read_point_cache
from .point_cache import write_point_cache as write_point_cache
from .resume import PartialRun as PartialRun
from .resume import recover as recover
from .trajectory import Trajectory as Trajectory
from .trajectory import TrajectoryError as TrajectoryError
from .writer import TrajectoryWriter as TrajectoryWriter

__all__ = [
    "PartialRun",
    "Trajectory",
    "TrajectoryError",
    "TrajectoryWriter",
    "read_point_cache",
    "recover",
    "write_point_cache",
]
