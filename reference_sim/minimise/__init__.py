"""Minimisers of a Potential: Newton's method and L-BFGS, with one loop, one call and one type of result.

>>> from reference_sim.minimise import MINIMISERS, STATUSES
>>> sorted(MINIMISERS), STATUSES[0]
(['lbfgs', 'newton'], 'converged')
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
