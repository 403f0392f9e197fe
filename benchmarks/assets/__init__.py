"""Body, garments and motions of a run: a user's files, each read once, and what is made for the body.

inputs: a user's own files. assets: body, tailored garments and motions of the dressed scenes. liveliest_part:
the clip of a motion.

>>> from benchmarks.assets import read_inputs
>>> round(read_inputs().wearer.height, 1)  # without files: the body of the package [m]
1.7
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
