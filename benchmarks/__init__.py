"""Scenes x methods: how accurate each method is, and at what cost. Run `python -m benchmarks.run --help`.

What a user's file declares (docs/extend.md) is imported from here. Nothing heavy is loaded before it is
used.

>>> from benchmarks import MethodEntry, Scene
>>> Scene(name="curtain", description="a curtain").dressed
False
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
