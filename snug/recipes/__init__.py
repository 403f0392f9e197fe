"""Recipes: every option of a training in one frozen place.

| module | what lies there |
| --- | --- |
| recipe | `Recipe`, its options and their checks; `DEFAULT` |
| named | the named recipes, and the recipe of each kind of network |
| deviations | the differences between the default recipe and the paper's text, one by one |
| energies | `find_energy`: any energy of the simulator as a term of the loss |

>>> from dataclasses import replace
>>> from snug.recipes import DEFAULT, find_recipe
>>> find_recipe("paper").pose_input, DEFAULT.pose_input
('axis_angle', 'six')
>>> replace(DEFAULT, name="longer", window=6, batch=8).window
6
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
