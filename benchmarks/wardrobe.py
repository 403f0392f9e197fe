"""What all dressed scenes share: one body, the garments tailored to it, and the motions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from .scenes import TSHIRT

if TYPE_CHECKING:
    import numpy as np

    from snug.body import Body
    from snug.garments import Garment
    from snug.motion import Motion

    from .presets import Preset


@dataclass(frozen=True)
class Wardrobe:
    """A body, what it may wear and the motions, all by name; each motion at most `preset.frames` long.

    bodies: motion -> posed body (T,B,3) [m], where it is ready made.
    """

    body: Body
    garments: dict[str, Garment]
    motions: dict[str, Motion]
    bodies: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def garment(self) -> Garment:
        """The T-shirt, which every study wears."""
        return self.garments[TSHIRT]

    def named(self, names: Iterable[str]) -> list[Motion]:
        """The motions of those names, in that order."""
        return [self.motions[name] for name in names]

    def of_motion(self, name: str) -> Wardrobe:
        """The same with this motion alone: little to hand to another process."""
        return replace(self, motions={name: self.motions[name]}, bodies={})

    def posed_body(self, name: str) -> np.ndarray:
        """The body (T,B,3) [m] in the motion of that name."""
        motion = self.motions[name]
        ready = self.bodies.get(name)
        return self.body.vertices(motion.poses, motion.translations) if ready is None else ready


def open_wardrobe(
    preset: Preset,
    motions: Iterable[Motion],
    garments: Iterable[str] = (TSHIRT,),
    *,
    body: Path | None = None,
) -> Wardrobe:
    """Load the body, or that of a file, tailor these garments and no other; motions are cut to the preset's
    length.

    The liveliest part of each is there too, under a name of its own: see clips.
    """
    from snug.body import Body
    from snug.garments import find_template

    from .clips import clip

    wearer = Body.from_file(body) if body else Body.load()
    tailored = {
        name: find_template(name).tailor(wearer, vertices=preset.garment_vertices) for name in garments
    }
    whole = [motion.cut(0, preset.frames) for motion in motions]
    clips = [clip(wearer, motion, preset.clip_frames) for motion in whole]
    return Wardrobe(wearer, tailored, {motion.name: motion for motion in (*whole, *clips)})


def embedded_motions(names: Iterable[str]) -> list[Motion]:
    """Motions of the embedded library."""
    from snug.motion_library import make_motion

    return [make_motion(name) for name in names]
