"""Body, garments and motions of a run: a user's files, each read once, and what is made for the body."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.provenance import digest

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.presets import Preset
    from snug.body.parametric_body import Body
    from snug.file_options import GarmentFile, MotionFileOptions
    from snug.garments.garment import Garment
    from snug.motion.motion import Motion

LIBRARY = "library"  # in place of a path: the embedded motions
FEWEST_FRAMES = 3  # of a motion: inertia needs two before the one that is evaluated


@dataclass(frozen=True, eq=False)
class Read:
    """A user's file as read: a body of SMPL's family, or a garment on the body of the run.

    name: of the garment, and first part of the names of its scenes.
    """

    path: Path
    content: Any
    name: str = ""

    @cached_property
    def digest(self) -> str:
        """Digest of what was read."""
        return digest(self.content)


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that a run takes from a user's files; without any, the package's body and garments."""

    body: Read | None = None
    garment: Read | None = None
    motions: Mapping[str, Motion] = field(default_factory=dict)  # by name, at full length

    @cached_property
    def wearer(self) -> Body:
        """The body that wears the garments: the user's, or the package's."""
        from snug.body.parametric_body import Body  # not needed where a run has no dressed scene

        return self.body.content if self.body else Body.load()


def read_inputs(
    body: Path | None = None,
    garment: GarmentFile | None = None,
    motions: Sequence[str] = (),
    motion_options: MotionFileOptions | None = None,
) -> Inputs:
    """Read a user's files: body, a mesh made for it, motions but for "library".

    Raises:
        ValueError: one line with file and remedy: BodyError, GarmentError, or MotionError, also for a
            motion that is too short or has the name of another.

    >>> read_inputs().garment is None
    True
    """
    inputs = Inputs(motions=_read_motions([path for path in motions if path != LIBRARY], motion_options))
    if body is not None:
        from snug.body.smpl_files import read_body  # loads scipy

        inputs = replace(inputs, body=Read(body, read_body(body)))
    if garment is not None:
        from snug.garments.reading import read_garment  # it loads libraries of meshes

        content = read_garment(garment, inputs.wearer)
        inputs = replace(inputs, garment=Read(garment.path, content, garment.name))
    return inputs


def _read_motions(files: Sequence[str], options: MotionFileOptions | None) -> dict[str, Motion]:
    motions: dict[str, Motion] = {}
    if not files:
        return motions
    from snug.motion.files import load_motions  # its readers are slow to load
    from snug.motion.library import CLIPS
    from snug.motion.library import LIBRARY as MADE
    from snug.motion.motion import MotionError

    for path in files:
        for motion in load_motions(path, options=options):
            # A file of a recorded clip's name takes the clip's place.
            if motion.name in motions or (motion.name in MADE and motion.name not in CLIPS):
                raise MotionError(f"--motions {path}: the name '{motion.name}' is taken; rename the file")
            if motion.frames < FEWEST_FRAMES:
                fault = f"{motion.frames} frames; at least {FEWEST_FRAMES} are needed"
                raise MotionError(f"--motions {path}: {fault}")
            motions[motion.name] = motion
    return motions


@dataclass(frozen=True)
class Assets:
    """A body, its garments and the motions, all by name; each as long as the preset lets it be.

    clips: motion -> frames of its liveliest part.
    """

    body: Body
    garments: dict[str, Garment]
    motions: dict[str, Motion]
    clips: dict[str, range]

    def pick(self, names: Iterable[str]) -> list[Motion]:
        """Return the motions of those names, in that order."""
        return [self.motions[name] for name in names]

    def motion(self, name: str, part: str) -> Motion:
        """Return the whole motion of that name, or its clip, named "<motion>@clip"."""
        motion = self.motions[name]
        if part != "clip":
            return motion
        frames = self.clips[name]
        return replace(motion.cut(frames.start, frames.stop), name=f"{name}@clip")

    def cut_before(self, name: str, part: str) -> Motion | None:
        """Return the motion before that part; None where the part begins with the motion."""
        start = self.clips[name].start if part == "clip" else 0
        return self.motions[name].cut(0, start) if start else None

    def only(self, motion: str) -> Assets:
        """Return the assets with this motion alone: little to hand to another process."""
        names = {motion} & self.motions.keys()
        motions = {name: self.motions[name] for name in names}
        return replace(self, motions=motions, clips={name: self.clips[name] for name in names})


def open_assets(
    preset: Preset,
    motions: Iterable[Motion],
    garments: Iterable[str],
    *,
    inputs: Inputs | None = None,
    training: Collection[str] = (),
    ready: Mapping[str, Garment] | None = None,
) -> Assets:
    """Tailor these garments to the body, but for the user's, and cut motions to the preset's lengths.

    Those named in `training` have another length. Garments in `ready` are not tailored. Raises ValueError
    for one that cannot be.

    >>> assets = open_assets(find_preset("smoke"), make_motions(["walk"]), ["tshirt"])  # doctest: +SKIP
    """
    inputs = inputs or Inputs()
    wearer, file = inputs.wearer, inputs.garment
    tailored = {}
    at_hand = {**(ready or {}), **({file.name: file.content} if file else {})}
    for name in garments:
        if (garment := at_hand.get(name)) is None:
            from snug.garments.templates import find_template  # loads libraries of meshes

            garment = find_template(name).tailor(wearer, vertices=preset.garment_vertices)
        tailored[name] = garment
    lengths = {True: preset.train_frames, False: preset.frames}
    cuts = [motion.cut(0, lengths[motion.name in training]) for motion in motions]
    clips = {
        motion.name: liveliest_part(wearer, motion, preset.clip_frames, preset.warm_up_frames)
        for motion in cuts
    }
    return Assets(wearer, tailored, {motion.name: motion for motion in cuts}, clips)


def make_motions(names: Iterable[str]) -> list[Motion]:
    """Make motions of the embedded library.

    >>> [motion.frames for motion in make_motions(["walk"])]
    [120]
    """
    from snug.motion.library import make_motion

    return [make_motion(name) for name in names]


def liveliest_part(body: Body, motion: Motion, frames: int, warm_up: int = 0) -> range:
    """Return the `frames` frames with the fastest joints on average, and `warm_up` before them.

    Of a motion too short they are all.
    """
    import numpy as np

    speed = joint_speeds(body, motion)
    sums = np.concatenate([[0.0], np.cumsum(speed)])
    steps = min(frames - 1, len(speed))
    before = min(warm_up, len(speed) - steps)
    start = int(np.argmax((sums[steps:] - sums[: len(sums) - steps])[before:]))
    return range(start, start + before + steps + 1)


def joint_speeds(body: Body, motion: Motion) -> np.ndarray:
    """Return the mean speed of the joints between two frames, (T - 1,) [m/s]."""
    import numpy as np

    transforms = body.transforms(motion.poses, motion.translations)
    joints = np.einsum("tjab,jb->tja", transforms[..., :3], body.joints()) + transforms[..., 3]
    return motion.fps * np.linalg.norm(np.diff(joints, axis=0), axis=2).mean(1)
