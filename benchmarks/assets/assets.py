"""Assets that all dressed scenes share: one body, the garments tailored to it, and the motions."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from benchmarks.assets.inputs import Inputs

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.presets import Preset
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.motion.motion import Motion


@dataclass(frozen=True)
class Assets:
    """A body, its garments and the motions, all by name; each as long as the preset lets it be.

    clips: motion -> frames of its liveliest part. bodies: motion or clip -> posed body (T,B,3) [m], where
    ready made.
    """

    body: Body
    garments: dict[str, Garment]
    motions: dict[str, Motion]
    clips: dict[str, range]
    bodies: dict[str, np.ndarray] = field(default_factory=dict)

    def named(self, names: Iterable[str]) -> list[Motion]:
        """Return the motions of those names, in that order."""
        return [self.motions[name] for name in names]

    def motion(self, name: str, part: str) -> Motion:
        """Return the whole motion of that name, or its clip, named "<motion>@clip"."""
        whole = self.motions[name]
        if part != "clip":
            return whole
        frames = self.clips[name]
        return replace(whole.cut(frames.start, frames.stop), name=f"{name}@clip")

    def before(self, name: str, part: str) -> Motion | None:
        """Return the motion before that part; None where the part begins with the motion."""
        start = self.clips[name].start if part == "clip" else 0
        return self.motions[name].cut(0, start) if start else None

    def only(self, motion: str) -> Assets:
        """Return the assets with this motion alone: little to hand to another process."""
        names = {motion} & self.motions.keys()
        motions = {name: self.motions[name] for name in names}
        return replace(self, motions=motions, clips={name: self.clips[name] for name in names}, bodies={})

    def posed_body(self, motion: Motion, betas: np.ndarray | None = None) -> np.ndarray:
        """Return the body (T,B,3) [m] of that shape, or of the mean one, in that motion."""
        ready = self.bodies.get(motion.name)
        return self.body.vertices(motion.poses, motion.translations, betas) if ready is None else ready


def open_assets(
    preset: Preset,
    motions: Iterable[Motion],
    garments: Iterable[str],
    *,
    inputs: Inputs | None = None,
    training: Collection[str] = (),
) -> Assets:
    """Tailor these garments and no others to the body, and cut motions to the preset's length.

    Args:
        preset: vertices of a garment, frames of a motion, of one that trains, and of a clip.
        motions: at their full length.
        garments: names of templates, or that of the user's garment, which is taken as read.
        inputs: the user's body and garment; without them the package's body.
        training: names of the motions that train.

    Raises:
        ValueError: a garment that cannot be tailored to this body.

    >>> assets = open_assets(find_preset("smoke"), embedded_motions(["walk"]), ["tshirt"])  # doctest: +SKIP
    """
    from benchmarks.assets.liveliest_part import liveliest_part
    from snug.garments.templates import find_template

    inputs = inputs or Inputs()
    wearer, user_garment = inputs.wearer, inputs.garment
    tailored = {
        name: user_garment.garment
        if user_garment and name == user_garment.name
        else find_template(name).tailor(wearer, vertices=preset.garment_vertices)
        for name in garments
    }
    longest = {True: preset.train_frames, False: preset.frames}
    whole = [motion.cut(0, longest[motion.name in training]) for motion in motions]
    clips = {
        motion.name: liveliest_part(wearer, motion, preset.clip_frames, preset.warm_up_frames)
        for motion in whole
    }
    return Assets(wearer, tailored, {motion.name: motion for motion in whole}, clips)


def embedded_motions(names: Iterable[str]) -> list[Motion]:
    """Make motions of the embedded library.

    >>> [motion.frames for motion in embedded_motions(["walk"])]
    [120]
    """
    from snug.motion.library import make_motion

    return [make_motion(name) for name in names]
