"""Files of other programs (meshes, UV charts, arrays), and files that appear whole or not at all.

>>> import numpy as np
>>> from reference_sim.files import to_metres_y_up
>>> to_metres_y_up(np.array([[100.0, 0.0, 50.0]]), units="cm", up="z").tolist()
[[1.0, 0.5, -0.0]]
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
