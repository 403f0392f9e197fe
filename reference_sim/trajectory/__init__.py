"""Trajectories: positions over time, their file, and how a run is written, resumed and exported.

>>> import numpy as np
>>> from reference_sim.trajectory import Trajectory
>>> still = Trajectory(np.zeros((3, 1, 3)), np.zeros((0, 3), int), times=np.arange(3) / 30)
>>> still.frames, round(still.dt, 4)
(3, 0.0333)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
