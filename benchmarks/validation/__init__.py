"""Validation: known answers and extreme steps. registry.py lists the modules whose functions declare them.

| where | known answers |
| --- | --- |
| shells | membrane and hinges: closed forms, scikit-fem, plates, large bending |
| motion | contact, friction, laws of backward Euler, orders in dt |
| known_surfaces | the curvature metric |
| derivatives, minimisers | derivatives of all terms but friction and IPC's barrier; the minimisers |
| extreme_steps | single steps that converge truly or fail and say so |
| fabric | textile tests of suite fabric |

>>> from benchmarks.validation import CASES
>>> next(case for case in CASES if case.name == "membrane_pull").run().status
'ok'
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
