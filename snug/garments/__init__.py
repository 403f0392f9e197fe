"""Garments: tailored by code to any body, or read from mesh files.

| module | what lies there |
| --- | --- |
| garment | `Garment`: mesh, openings, skinning weights, pins |
| templates | the garments that are tailored by code: `GARMENT_TEMPLATES`, `find_template` |
| assembly, implicit_surface, cuts, meshing, remeshing | how tailoring works, in this order |
| landmarks | joints and skin of the body that garments are cut by |
| reading | `read_garment`: a mesh file, checked; what `python -m snug.check` says of it |
| options, fit, openings, weights, picture | parts of reading: command-line options, place on the body |

>>> from snug.garments import GARMENT_TEMPLATES, find_template
>>> [template.name for template in GARMENT_TEMPLATES][:3]
['tshirt', 'tunic', 'skirt']
>>> from snug.body import Body
>>> skirt = find_template("skirt").tailor(Body.load(), vertices=1000)  # takes 3 s  # doctest: +SKIP
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
