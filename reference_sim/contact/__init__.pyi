from .closest_point import Closest as Closest
from .closest_point import FaceTree as FaceTree
from .collisions import Collisions as Collisions

__all__ = ["Closest", "Collisions", "FaceTree"]
