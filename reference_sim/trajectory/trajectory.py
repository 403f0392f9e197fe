"""Trajectory: positions over time, whether and how they converged, and its file.

The file is VTKHDF (temporal PolyData), so ParaView opens it as it is; what VTK has no place for lies in the
top-level group /benchmark.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.files.array_file import MOST_PACKED
from reference_sim.files.trial import try_out
from reference_sim.trajectory.writer import TrajectoryWriter

if TYPE_CHECKING:
    import h5py


TRAJECTORY_SUFFIXES = (".vtkhdf", ".hdf")
ALWAYS_READ = 1 << 20  # [bytes] that nobody minds


class TrajectoryError(ValueError):
    """Trajectory file that cannot be read; the message names file and remedy."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Positions of one cloth over time.

    Attributes:
        positions: (T, V, 3) [m].
        faces: (F, 3).
        times: (T,) [s].
        frame_seconds: (T,) time on the clock for each frame [s]; nan where none was taken, as by default.
        status: "converged", or the worst failure among the frames ("diverged", then "timeout", then "stalled"
            or "max_iterations"); "ok" for a method that does not minimise.
        reason: one line in words, on the first frame with that status.
        provenance: what made it (JSON values).
        frame_fields: further numbers per frame, each (T,).

    Example: two frames of a triangle, to a file and back.

        >>> import tempfile
        >>> import numpy as np
        >>> from reference_sim import Trajectory
        >>> x = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
        >>> rise = Trajectory(np.stack([x, x + 0.01]), np.array([[0, 2, 1]]), times=np.array([0.0, 0.02]))
        >>> rise.frames, rise.dt, rise.status
        (2, 0.02, 'ok')
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     rise.save(f"{folder}/rise.vtkhdf")
        ...     again = Trajectory.load(f"{folder}/rise.vtkhdf")
        >>> bool((again.positions == rise.positions).all())
        True
    """

    positions: np.ndarray
    faces: np.ndarray
    times: np.ndarray
    frame_seconds: np.ndarray = field(default_factory=lambda: np.empty(0))
    status: str = "ok"
    reason: str = ""
    provenance: dict[str, Any] = field(default_factory=dict)
    frame_fields: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not len(self.frame_seconds):
            object.__setattr__(self, "frame_seconds", np.full(self.frames, np.nan))

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.positions)

    @property
    def dt(self) -> float:
        """Time between frames [s]."""
        return float(self.times[1] - self.times[0]) if self.frames > 1 else float("nan")

    def save(self, path: str | Path) -> None:
        """Write the whole file under a temporary name, then put it in place."""
        count = self.positions.shape[1]
        with TrajectoryWriter(path, self.faces, self.provenance, vertex_count=count) as writer:
            writer.extend(self.positions, self.times, self.frame_seconds, self.frame_fields)
            writer.finish(self.status, self.reason)

    @classmethod
    def load(cls, path: str | Path, *, guarded: bool = False) -> Trajectory:
        """Read a file of this project; an unfinished one gives its whole frames and status "unfinished".

        Args:
            path: the file.
            guarded: whether a process of its own tries the file first, which takes some 0.2 s: for files
                of others. A file can be made, or damaged, so that it crashes HDF5.

        Raises:
            TrajectoryError: missing file, or not a trajectory.
        """
        try:
            if guarded and Path(path).is_file() and (wrong := try_out(read_file, Path(path))):
                raise ValueError(wrong)
            return read_file(Path(path))
        except FileNotFoundError:
            raise TrajectoryError(f"{path}: no such trajectory file") from None
        except ImportError:
            raise
        except Exception as error:  # whatever h5py and numpy raise for a file that is none, or is damaged
            reason = " ".join(str(error).split())
            raise TrajectoryError(f"{path}: not a VTKHDF trajectory of this project ({reason})") from None

    def first(self, count: int) -> Trajectory:
        """Return the first `count` frames, or all if there are fewer."""
        return replace(
            self, positions=self.positions[:count], times=self.times[:count],
            frame_seconds=self.frame_seconds[:count],
            frame_fields={name: values[:count] for name, values in self.frame_fields.items()},
        )  # fmt: skip

    def finite(self) -> Trajectory:
        """Return the frames before the first in which a position is not finite."""
        whole = np.isfinite(self.positions).all(axis=(1, 2))
        return self if whole.all() else self.first(int(np.argmin(whole)))


def read_file(path: Path) -> Trajectory:
    """Read all whole frames of a file.

    Raises:
        Exception: of any kind, for a file that is no trajectory or is damaged.
    """
    import h5py

    with h5py.File(path, "r") as file:
        return read_frames(file)


def read_frames(file: h5py.File, *, frames: int | None = None) -> Trajectory:
    """Read the first `frames` frames of an open file, by default all that are whole.

    Raises:
        Exception: of any kind, for a file that is no trajectory or is damaged.
    """
    benchmark, vtk = file["benchmark"], file["VTKHDF"]
    provenance = json.loads(benchmark.attrs["provenance"])
    if not isinstance(provenance, dict):
        raise ValueError("its provenance is no JSON object")
    frames = int(benchmark.attrs["frames"]) if frames is None else frames
    vertex_count = int(_whole(vtk["NumberOfPoints"])[0])
    return Trajectory(
        positions=_whole(vtk["Points"], frames * vertex_count).reshape(frames, vertex_count, 3),
        faces=_whole(vtk["Polygons/Connectivity"]).reshape(-1, 3),
        times=_whole(vtk["Steps/Values"], frames),
        frame_seconds=_whole(benchmark["frame_seconds"], frames),
        status=str(benchmark.attrs["status"]),
        reason=str(benchmark.attrs["reason"]),
        provenance=provenance,
        frame_fields={k.replace(":", "/"): _whole(v, frames) for k, v in benchmark["frame_fields"].items()},
    )


def _whole(dataset: h5py.Dataset, rows: int | None = None) -> np.ndarray:
    """Read the first rows of a dataset, by default all, once their size is that of what is stored.

    Raises:
        ValueError: it declares more numbers than its file can hold, or no plain numbers.
    """
    rows = len(dataset) if rows is None else rows
    if not 0 <= rows <= len(dataset) or dataset.dtype.kind not in "if":
        raise ValueError(f"{dataset.name} has {dataset.shape} of {dataset.dtype}")
    size = int(np.prod(dataset.shape, dtype=object)) * dataset.dtype.itemsize
    # Of the file and not of the dataset, whose index a kill may have left ahead of the whole frames.
    if size > MOST_PACKED * dataset.file.id.get_filesize() + ALWAYS_READ:
        raise ValueError(f"{dataset.name} declares {size} bytes, more than its file can hold")
    return dataset[:rows]
