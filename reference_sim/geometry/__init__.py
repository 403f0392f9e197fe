"""Geometry of triangle meshes: areas, angles, boundary loops, normals, closest points, closed surfaces.

>>> import numpy as np
>>> from reference_sim.geometry import boundary_loops, triangle_areas
>>> square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
>>> faces = np.array([[0, 2, 1], [0, 3, 2]])
>>> triangle_areas(square, faces).tolist()
[0.5, 0.5]
>>> [loop.tolist() for loop in boundary_loops(faces)]
[[2, 1, 0, 3]]
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
