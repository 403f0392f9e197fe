"""Validation: known answers and stress tests. Each room declares its cases; registry.py lists them.

| room | known answers |
| --- | --- |
| membrane, bending | closed forms, scikit-fem, plates, the elastica, buckling |
| contact, friction | planes, spheres, drums, slopes, belts |
| dynamics | discrete laws of backward Euler, orders in dt, dependence on mesh and time step |
| curvature | the curvature metric on known surfaces |
| fabric | textile tests: the master curve, bending lengths and drape, of suite fabric |
| engines | laws that any engine owes, and its distance from its own limit, of suite engines |
| solvers | derivatives of all terms but friction and IPC's barrier, properties of the minimisers |
| stress | single steps that converge truly or fail and say so |

>>> from benchmarks.validation import CASES
>>> next(case for case in CASES if case.name == "membrane_pull").run().status
'ok'
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
