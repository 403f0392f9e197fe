"""The reference solver: cloth physics and its minimisers. It imports nothing else of this project.

A `Cloth` is a mesh at rest with its `Material`; energies of it (reference_sim.energies) add up to a
`Potential`; `minimise` finds the minimum of one, `simulate` a `Trajectory` of them over time, past an
`Obstacle` where there is one. Each name is imported when first used, so a scene pays for what it has.

>>> import numpy as np
>>> from reference_sim import Cloth, Potential
>>> from reference_sim.energies import Gravity
>>> corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
>>> cloth = Cloth(corners, np.array([[0, 2, 1]]))
>>> round(Potential([Gravity(cloth)]).value(corners + [0.0, 1.0, 0.0]), 5)  # m g h [J]
0.00982
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
