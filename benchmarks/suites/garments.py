"""Suite garments: every method on motions that no network has seen."""

from __future__ import annotations

from collections.abc import Sequence

from ..methods.learned import LEARNED

METHODS = ("simulation", "skinning", "untrained", "snug", "supervised", "pbns")
# Only where methods are named, or at a preset that holds all.
FURTHER = tuple(entry.name for entry in LEARNED)


def scenes(test_motions: Sequence[str], *, full: bool) -> list[str]:
    """One dressed body for each test motion, in a full run and in its quick subset alike."""
    return [f"dressed/{name}" for name in test_motions]


def methods(newton_cuts: Sequence[int]) -> list[str]:
    """The paper's methods; truncated solvers are in suite speed."""
    return list(METHODS)
