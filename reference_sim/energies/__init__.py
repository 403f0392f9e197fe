"""Physical terms: formula with its source, definition in torch, kernels in float64, in one file each.

Beside it lies, where a term has them, a file of the kernels for solvers and training. A new term is one
file and its line in `__init__.pyi`. A file is imported when the term's name is first used.

>>> from reference_sim import Cloth
>>> from reference_sim.energies import StretchStVK
>>> cloth = Cloth([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]], [[0, 2, 1]])
>>> value, gradient = StretchStVK(cloth).value_and_gradient(1.1 * cloth.rest_positions)
>>> round(value, 4), gradient.shape  # J; N at each vertex
(0.0035, (3, 3))
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
