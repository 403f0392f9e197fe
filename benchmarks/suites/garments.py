"""Suite garments: every method on motions that no network has seen."""

from __future__ import annotations

from collections.abc import Sequence

from ..methods.learned import LEARNED

METHODS = ("simulation", "skinning", "untrained", "snug", "supervised", "pbns")
SWINGING = ("tunic", "skirt")
# Only where methods are named, or at a preset that holds all.
FURTHER = (*(entry.name for entry in LEARNED), "simulation-moved", "lbfgs-5", "lbfgs-10")


def scenes(
    test_motions: Sequence[str], swing_motions: Sequence[str], *, full: bool, further: bool
) -> list[str]:
    """A T-shirt in each test motion; what swings too where scenes are named, or at preset paper."""
    swinging = [f"{worn}/{name}" for worn in SWINGING for name in swing_motions if further]
    return [f"dressed/{name}" for name in test_motions] + swinging


def methods(newton_cuts: Sequence[int]) -> list[str]:
    """The paper's methods; truncated solvers are in suite speed."""
    return list(METHODS)
