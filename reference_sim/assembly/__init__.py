"""Sparse Hessians: their pattern, and their Cholesky factorisation.

>>> import numpy as np
>>> from reference_sim.assembly import analyse
>>> solver = analyse(np.array([0, 2, 3]), np.array([0, 1, 1]), np.arange(2))  # lower triangle, by columns
>>> solver.factorise(np.array([4.0, 2.0, 3.0]))  # [[4, 2], [2, 3]]
True
>>> solver.solve(np.array([8.0, 8.0])).round(9).tolist()
[1.0, 2.0]
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
