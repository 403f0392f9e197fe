"""A user's own body, garment and motions: each file is read once, when a run is planned.

The digests are those of the contents as read, so that no file is opened a second time to know it again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.provenance import digest

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.file_options import GarmentFile, MotionFileOptions
    from snug.garments.garment import Garment
    from snug.motion.motion import Motion

LIBRARY = "library"  # in place of a path: the embedded motions
FEWEST_FRAMES = 3  # of a motion: inertia needs two before the one that is evaluated


class InputError(ValueError):
    """A user's file that cannot take part in a run; the message names file and remedy."""


@dataclass(frozen=True, eq=False)
class UserBody:
    """A body of SMPL's family, and the file that it was read from."""

    path: Path
    body: Body

    @cached_property
    def digest(self) -> str:
        """Digest of the body as read."""
        return digest(self.body)


@dataclass(frozen=True, eq=False)
class UserGarment:
    """A garment on the body of the run, and the file that it was read from."""

    file: GarmentFile
    garment: Garment

    @property
    def name(self) -> str:
        """Name of the garment, and first part of the names of its scenes."""
        return self.file.name

    @cached_property
    def digest(self) -> str:
        """Digest of the garment as read: of its file, of the options, and of the body that wears it."""
        return digest(self.garment)


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that a run takes from a user's files; without any, the package's body and garments.

    motions: name -> motion at its full length.
    """

    body: UserBody | None = None
    garment: UserGarment | None = None
    motions: Mapping[str, Motion] = field(default_factory=dict)

    @cached_property
    def wearer(self) -> Body:
        """The body that wears the garments: the user's, or the package's."""
        if self.body is not None:
            return self.body.body
        from snug.body.parametric_body import Body  # not needed where a run has no dressed scene

        return Body.load()


def read_inputs(
    body: Path | None = None,
    garment: GarmentFile | None = None,
    motions: Sequence[str] = (),
    motion_options: MotionFileOptions | None = None,
) -> Inputs:
    """Read a user's files.

    Args:
        body: file of SMPL's family, .npz or .pkl; None: the package's body.
        garment: mesh made for that body, and how to take it; None: garments are tailored.
        motions: paths of files and folders; "library" is passed over.
        motion_options: what the files of motions do not say.

    Raises:
        ValueError: one line with file and remedy: BodyError, GarmentError, MotionError, or InputError for a
            motion that is too short or has the name of another.

    >>> read_inputs().garment is None
    True
    """
    worn = None if body is None else UserBody(body, _read_body(body))
    inputs = Inputs(worn, motions=_read_motions(motions, motion_options))
    if garment is None:
        return inputs
    from snug.garments.reading import read_garment  # it loads libraries of meshes

    return Inputs(worn, UserGarment(garment, read_garment(garment, inputs.wearer)), inputs.motions)


def _read_body(path: Path) -> Body:
    from snug.body.smpl_files import read_body  # loads scipy

    return read_body(path)


def _read_motions(paths: Sequence[str], options: MotionFileOptions | None) -> dict[str, Motion]:
    motions: dict[str, Motion] = {}
    files = [path for path in paths if path != LIBRARY]
    if not files:
        return motions
    from snug.motion.files import load_motions  # its readers are slow to load
    from snug.motion.library import CLIPS
    from snug.motion.library import LIBRARY as MADE

    for path in files:
        for motion in load_motions(path, options=options):
            # A file of a recorded clip's name takes the clip's place.
            if motion.name in motions or (motion.name in MADE and motion.name not in CLIPS):
                raise InputError(f"--motions {path}: the name '{motion.name}' is taken; rename the file")
            if motion.frames < FEWEST_FRAMES:
                raise InputError(
                    f"--motions {path}: {motion.frames} frames; at least {FEWEST_FRAMES} are needed"
                )
            motions[motion.name] = motion
    return motions
