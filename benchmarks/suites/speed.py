"""Suite speed: how accurate a method is at what time a frame, one thread, one frame at a time.

Dressed bodies are clips, the liveliest part of a motion: here every solver goes through every frame.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..results import CLIP

SMALL = ("hanging_sheet", "sheet_on_sphere", "flag", "twisted_strip")
EXACT = ("free_fall",)  # every method has no error there but round-off: only for whoever names it
LIVELY = ("sudden_stop", "spin_jump")  # of the library's test motions: a run and its stop, a jump with a turn
# Of the motions for garments that swing: a walk that turns, its clip before the stop. No training saw its
# turning; its strides are those of the T-shirt's training walks, so it is the easiest scene for networks.
SWINGING = ("turning_stop",)

# The reference from coarse to fine in tolerance and in time, and from a start moved by 1e-9 m.
REFERENCES = (
    "simulation", "simulation-1e-2", "simulation-1e-8", "simulation-dt/2", "simulation-dt/4",
    "simulation-dt/8", "simulation-moved",
)  # fmt: skip
FEW_REFERENCES = ("simulation", "simulation-1e-2", "simulation-dt/2", "simulation-moved")
FAMILIES = (("newton-", 1), ("lbfgs-", 5), ("snug+lbfgs-", 1))  # iterations per unit of a preset's cuts
RIVALS = ("gradient-descent-10", "vbd-20", "xpbd-40", "skinning+lbfgs-4", "snug+newton-2")
PEERS = ("newton-vbd", "newton-xpbd")  # skipped where the package is not installed
LEARNED = ("skinning", "snug", "supervised", "pbns")
# Only where methods are named, or at a preset that holds all; learned ones as in suite garments.
FURTHER = (
    "pbns-springs", "santesteban2019", "tailornet", "simulation-1e-4", "gradient-descent-40", "vbd-5",
    "vbd-80",
    "xpbd-10", "xpbd-160", "skinning+lbfgs-1", "skinning+lbfgs-2", "skinning+lbfgs-8", "skinning+newton-1",
    "skinning+newton-2", "skinning+newton-4", "skinning+newton-8", "snug+newton-1", "snug+newton-4",
    "snug+newton-8",
)  # fmt: skip


def scenes(
    test_motions: Sequence[str], swing_motions: Sequence[str], *, full: bool, further: bool
) -> list[str]:
    """Small scenes and clips of dressed bodies; the quick subset is one of each."""
    lively = [name for name in test_motions if name in LIVELY] or list(test_motions[:2])
    if not full:
        return [SMALL[0], *(f"dressed/{name}{CLIP}" for name in lively[:1])]
    swinging = [name for name in swing_motions if name in SWINGING]
    shirts = [f"dressed/{name}{CLIP}" for name in (*lively, *swinging)]
    return [*SMALL, *(EXACT if further else ()), *shirts, *(f"skirt/{name}{CLIP}" for name in swinging)]


def methods(newton_cuts: Sequence[int]) -> list[str]:
    """The reference, solvers cut short and everything learned; few cuts mean few references too."""
    references = REFERENCES if len(newton_cuts) > 2 else FEW_REFERENCES
    families = [f"{name}{scale * cut}" for name, scale in FAMILIES for cut in newton_cuts]
    return [*references, *families, *RIVALS, *PEERS, *LEARNED]
