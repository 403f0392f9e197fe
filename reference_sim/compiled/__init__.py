"""A truncated solver in compiled calls: approximations of parts of this package that are held to them.

CompiledLBFGS stands for minimise.LBFGS, SlidingObstacle for obstacle.Obstacle. Each can be used without the
other.
"""

from .minimiser import CompiledLBFGS
from .sliding_obstacle import SlidingObstacle

__all__ = ["CompiledLBFGS", "SlidingObstacle"]
