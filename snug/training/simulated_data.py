"""Data sets: simulated motions in the files of one folder, and an index of them, dataset.json.

A sequence is three files: its simulation (.vtkhdf), the motion (.npz), and the simulated vertices as networks
see them (.npy), of which training reads a few frames at a time. The index says what all sequences share (the
settings), and of each its files with their digests, its frames and how it ended. `python -m
benchmarks.dataset` builds such folders.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.files.array_file import read_arrays, write_array
from reference_sim.files.atomic_files import replacing
from snug.motion.motion import Motion

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.training.losses.vertex_targets import StoredVertices

INDEX, DATA_SET_FORMAT = "dataset.json", 1
MISSING = "missing"  # status of a sequence that was asked for and is not there yet
_TYPES: dict[str, Any] = {
    "name": str, "trajectory": str, "motion": str, "vertices": str, "digests": dict, "frames": int,
    "status": str, "reason": str, "usable": bool, "seconds": int | float, "hardware": str, "commit": str,
}  # fmt: skip
MICROMETRES = 6  # decimals of positions [m] that count: another processor may tailor the last bits otherwise


class DataSetError(ValueError):
    """A folder that holds no data set, or not the one that is wanted; the message names what is wrong."""


@dataclass(frozen=True)
class SimulatedSequence:
    """A line of the index.

    Attributes:
        name: of the motion.
        trajectory, motion, vertices: names of its files in the folder.
        digests: of these files, by name.
        frames: number of simulated frames.
        status: of the simulation, or MISSING.
        reason: of a failure.
        usable: whether it has all frames of the motion.
        seconds: wall time of the simulation [s].
        hardware: on which it ran.
        commit: of the code that ran.
    """

    name: str
    trajectory: str = ""
    motion: str = ""
    vertices: str = ""
    digests: Mapping[str, str] = field(default_factory=dict)
    frames: int = 0
    status: str = MISSING
    reason: str = ""
    usable: bool = False
    seconds: float = 0.0
    hardware: str = ""
    commit: str = ""


@dataclass(frozen=True)
class DataSet:
    """A folder and its index.

    Attributes:
        folder: holds the index and all files.
        settings: common to all sequences, see `settings_of`.
        sequences: lines of the index.
        commands: those that made the data set.
    """

    folder: Path
    settings: Mapping[str, Any]
    sequences: tuple[SimulatedSequence, ...] = ()
    commands: tuple[str, ...] = ()

    @classmethod
    def read(cls, folder: str | Path) -> DataSet:
        """Read the index of a folder; the other files are not opened. Raises DataSetError."""
        path = Path(folder) / INDEX
        try:
            index = json.loads(path.read_text(encoding="utf-8"))
            if index["format"] != DATA_SET_FORMAT:
                raise DataSetError(
                    f"{path}: format {str(index['format'])[:20]!r}; this version reads {DATA_SET_FORMAT}"
                )
            lines = tuple(_line(line) for line in index["sequences"])
            if len({line.name for line in lines}) < len(lines):
                raise ValueError("two sequences have one name")
            settings = dict(index["settings"].items())
            return cls(Path(folder), settings, lines, tuple(map(str, index["commands"])))
        except DataSetError:
            raise
        except FileNotFoundError:
            raise DataSetError(f"{path}: no such file; make one by python -m benchmarks.dataset") from None
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            reason = " ".join(f"{type(error).__name__} {error}".split())[:200]
            raise DataSetError(f"{path}: no index of a data set ({reason})") from None

    def write(self) -> None:
        """Write the index, whole or not at all."""
        index = {
            "format": DATA_SET_FORMAT,
            "settings": self.settings,
            "commands": self.commands,
            "sequences": [asdict(line) for line in self.sequences],
        }
        with replacing(self.folder / INDEX) as temporary:
            temporary.write_text(json.dumps(index, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")

    @property
    def usable(self) -> list[SimulatedSequence]:
        """Sequences to learn from."""
        return [line for line in self.sequences if line.usable]

    def motions(self) -> list[Motion]:
        """Read the motions of the usable sequences. Raises ValueError for an unfit file."""
        return [read_motion(self.folder / line.motion, line) for line in self.usable]

    def targets(self) -> dict[str, StoredVertices]:
        """Return name -> vertices of each usable sequence; they stay in their files."""
        from snug.training.losses.vertex_targets import StoredVertices

        count = int(self.settings["vertices"])
        return {
            line.name: StoredVertices(
                self.folder / line.vertices, (line.frames, count, 3), line.digests[line.vertices]
            )
            for line in self.usable
        }

    def check(self, settings: Mapping[str, Any]) -> None:
        """Raise DataSetError unless the data set has these settings."""
        for name, value in settings.items():
            if (stored := self.settings.get(name)) != value:
                values = f": {stored} there, {value} here" if isinstance(value, str | int | float) else ""
                raise DataSetError(f"{self.folder}: a data set of another {name}{values}")


def settings_of(body: Body, garment: Garment) -> dict[str, Any]:
    """Return the facts that must be equal for simulations of a garment on a body to be of the same cloth."""
    weights = np.round(garment.skinning_weights[garment.pins], MICROMETRES)
    rest = [np.round(garment.rest_positions, MICROMETRES), garment.faces, garment.pins, weights]
    if garment.rest_uv is not None:
        rest.append(np.round(garment.rest_uv, MICROMETRES))
    skin = [body.template, body.skinning_weights, body.joint_template]
    if body.pose_directions is not None:
        skin.append(body.pose_directions)
    return {
        "garment": garment.name,
        "vertices": len(garment.rest_positions),
        "mesh": _digest(rest),
        "material": asdict(garment.material),
        "body": _digest([*(np.round(array, MICROMETRES) for array in skin), body.faces]),
    }


def write_motion(path: Path, motion: Motion) -> None:
    """Write poses (T, 24, 3) [rad], translations (T, 3) [m] and fps to an .npz file."""
    with replacing(path) as temporary:
        np.savez(temporary, poses=motion.poses, translations=motion.translations, fps=motion.fps)


def write_vertices(path: Path, positions: np.ndarray, motion: Motion, body: Body) -> None:
    """Write simulated world positions (T, V, 3) [m] as training reads them: from the pelvis, float32."""
    pelvis = body.joints()[0] + motion.translations[: len(positions)]
    with replacing(path) as temporary:
        write_array(temporary, (positions - pelvis[:, None]).astype(np.float32))


def read_motion(path: Path, line: SimulatedSequence) -> Motion:
    """Read the motion of a sequence. Raises ValueError for a file that does not hold it."""
    arrays = read_arrays(path, ("poses", "translations", "fps"))
    try:
        motion = Motion(line.name, arrays["poses"], arrays["translations"], float(arrays["fps"]), "simulated")
    except (KeyError, TypeError) as error:
        raise DataSetError(f"{path}: no motion of a data set ({error}); build the data set again") from None
    if motion.frames != line.frames:
        raise DataSetError(f"{path}: {motion.frames} frames, {line.frames} by {INDEX}; make it again")
    return motion


def _digest(arrays: Sequence[np.ndarray]) -> str:
    """Return a digest of shapes and values; a zero has no sign."""
    digest = hashlib.sha256()
    for array in arrays:
        plain = np.asarray(array, np.float64) + 0.0
        digest.update(repr(plain.shape).encode() + plain.tobytes())
    return digest.hexdigest()[:16]


def _line(line: Mapping[str, Any]) -> SimulatedSequence:
    """Read a line. Raises ValueError for an invalid entry, or a file outside of the folder."""
    sequence = SimulatedSequence(**line)
    for name, kind in _TYPES.items():
        if not isinstance(value := getattr(sequence, name), kind):
            raise ValueError(f"sequence {str(sequence.name)[:60]!r}: {name} is {str(value)[:40]!r}")
    files = {sequence.trajectory, sequence.motion, sequence.vertices}
    for name in filter(None, (*files, *sequence.digests)):
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            raise ValueError(f"sequence {sequence.name!r}: its file {name!r} lies outside of the folder")
    if sequence.usable and not files <= set(sequence.digests):
        raise ValueError(f"sequence {sequence.name!r}: no digest of its files")
    return sequence
