"""Neural garments: bodies, garments, motions, networks and their training.

The function that trains is `train_network`; `snug.train` is the command.

A small top of the chest's own skin, a static network trained for two steps, and its roll-out:

>>> import numpy as np
>>> import snug
>>> from snug.recipe import Recipe
>>> body = snug.Body.load()
>>> chest = body.skinning_weights[:, 9] > 0.9
>>> vertices, faces = np.unique(body.faces[chest[body.faces].all(axis=1)], return_inverse=True)
>>> weights = body.skinning_weights[vertices]
>>> top = snug.Garment("top", body.template[vertices], faces.reshape(-1, 3), vertices, weights)
>>> dressed = snug.DressedBody(body, top)
>>> poses = np.zeros((4, 24, 3))
>>> poses[:, 9, 1] = np.linspace(0.0, 0.4, 4)  # the chest turns [rad]
>>> motion = snug.Motion("turn", poses, np.zeros((4, 3)))
>>> recipe = Recipe(terms=("strain", "bending", "gravity"), mixed=0.0)
>>> model = snug.train_network("pbns", dressed, [motion], steps=2, seed=0, recipe=recipe, kernels=False,
...                            progress=False)
>>> snug.roll_out(model, dressed, motion).positions.shape  # (T, V, 3) [m]
(4, 51, 3)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
