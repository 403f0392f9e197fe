"""Frame of every command of the project, and the command `python -m reference_sim.simulate`.

>>> from reference_sim.command import Parser, command
>>> Parser(prog="tools.halve").prog
'tools.halve'
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
