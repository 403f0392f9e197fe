"""Suite garments: every method on motions that no network has seen."""

from __future__ import annotations

from collections.abc import Sequence

from ..methods.learned import LEARNED

METHODS = ("simulation", "skinning", "untrained", "snug", "supervised", "pbns")
# Only where methods are named, or at a preset that holds all.
FURTHER = (*(entry.name for entry in LEARNED), "lbfgs-5", "lbfgs-10")


def scenes(
    test_motions: Sequence[str], swing_motions: Sequence[str], *, full: bool, further: bool
) -> list[str]:
    """A T-shirt in each test motion; a tunic too where scenes are named, or at a preset that holds all."""
    tunics = [f"tunic/{name}" for name in swing_motions if further]
    return [f"dressed/{name}" for name in test_motions] + tunics


def methods(newton_cuts: Sequence[int]) -> list[str]:
    """The paper's methods; truncated solvers are in suite speed."""
    return list(METHODS)
