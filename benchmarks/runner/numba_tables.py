"""numba's tables of functions, filled by the import of this module.

The server that forks processes fills them once. Else each process takes 0.2 s for it at its first kernel.
"""

from numba.core.registry import cpu_target

cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
