"""What all dressed scenes share: one body, one T-shirt tailored to it, and the motions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from snug.body import Body
    from snug.garments import Garment
    from snug.motion import Motion

    from .presets import Preset


@dataclass(frozen=True)
class Wardrobe:
    """A body, the garment it wears and the motions by name, each at most `preset.frames` long."""

    body: Body
    garment: Garment
    motions: dict[str, Motion]

    def named(self, names: Iterable[str]) -> list[Motion]:
        """The motions of those names, in that order."""
        return [self.motions[name] for name in names]


def open_wardrobe(preset: Preset, motions: Iterable[Motion]) -> Wardrobe:
    """Load the body and tailor the T-shirt (about ten seconds); motions are cut to the preset's length."""
    from snug.body import Body
    from snug.garments import tailor_tshirt

    body = Body.load()
    garment = tailor_tshirt(body, vertices=preset.garment_vertices)
    return Wardrobe(body, garment, {m.name: m.cut(0, preset.frames) for m in motions})


def embedded_motions(names: Iterable[str]) -> list[Motion]:
    """Motions of the embedded library."""
    from snug.motion import make_motion

    return [make_motion(name) for name in names]
