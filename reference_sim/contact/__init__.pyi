from .closest_point import Closest as Closest
from .closest_point import FaceSearch as FaceSearch
from .collisions import Collisions as Collisions

__all__ = ["Closest", "Collisions", "FaceSearch"]
