"""numba's tables of functions, filled by the import of this module.

The server that forks processes fills them once. Else each process takes 0.2 s for it at its first kernel.
"""

from numba.core.registry import cpu_target

import reference_sim.kernels.kernel_cache  # noqa: F401  it names the processor's features: the tables keep them

cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
