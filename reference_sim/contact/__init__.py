"""Search for contact: closest faces of a moving mesh, pairs of primitives that are close.

>>> import numpy as np
>>> from reference_sim.contact import FaceSearch
>>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
>>> search = FaceSearch(np.array([[0, 2, 1]]), corners.mean(axis=0, keepdims=True))
>>> search.refit(corners)
>>> search.nearest(np.array([[0.25, 0.5, 0.25]])).points.tolist()
[[0.25, 0.0, 0.25]]
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
