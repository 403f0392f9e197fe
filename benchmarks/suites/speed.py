"""Suite speed: how accurate a method is at what time a frame, one thread, one frame at a time."""

from __future__ import annotations

from collections.abc import Sequence

FURTHER = ("pbns-springs", "santesteban2019", "tailornet")  # as in suite garments


def scenes(test_motions: Sequence[str], *, full: bool) -> list[str]:
    """Small scenes and dressed bodies; the quick subset is one of each."""
    small = ["hanging_sheet", "sheet_on_sphere", "free_fall"] if full else ["hanging_sheet"]
    return small + [f"dressed/{name}" for name in (test_motions if full else test_motions[:1])]


def methods(newton_cuts: Sequence[int]) -> list[str]:
    """The reference, the same solver cut short, and everything learned."""
    cuts = [f"newton-{cut}" for cut in newton_cuts]
    return ["simulation", *cuts, "skinning", "snug", "supervised", "pbns"]
