"""Reads the trajectory files of a run: VTKHDF temporal PolyData, through h5py alone.

Numbers per frame lie in /benchmark/frame_fields; the slash of "energy/strain" is a colon there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np


class MeshFileError(ValueError):
    """A trajectory file is no VTKHDF triangle mesh over time; the message names it."""


@dataclass(frozen=True)
class MeshSeries:
    """A triangle mesh over time, positions left in the file until asked for."""

    path: Path
    faces: np.ndarray  # (F, 3)
    times: np.ndarray  # (T,) [s]
    vertices: int
    fields: dict[str, np.ndarray]  # numbers per frame, (T,) each

    @property
    def frames(self) -> int:
        return len(self.times)

    def positions(self, frame: int) -> np.ndarray:
        """(V, 3) positions [m] at a frame; a negative frame counts from the end."""
        first = range(self.frames)[frame] * self.vertices
        with h5py.File(self.path, "r") as file:
            return np.asarray(file["VTKHDF/Points"][first : first + self.vertices], dtype=float)


def read_series(path: Path) -> MeshSeries:
    """Open a trajectory file. Raises MeshFileError naming the file and what is wrong with it."""
    try:
        with h5py.File(path, "r") as file:
            root = file["VTKHDF"]
            vertices = int(root["NumberOfPoints"][0])
            # A killed writer may leave a torn last frame: the file's own count is of whole ones.
            frames = int(file["benchmark"].attrs["frames"])
            times = np.asarray(root["Steps/Values"][:frames], dtype=float)
            connectivity = np.asarray(root["Polygons/Connectivity"], dtype=np.int64)
            points = root["Points"].shape
            fields = {
                name.replace(":", "/"): np.asarray(values[:frames], dtype=float)
                for name, values in file["benchmark/frame_fields"].items()
            }
    except (OSError, KeyError, IndexError, ValueError) as error:
        raise MeshFileError(f"{path}: no VTKHDF mesh over time ({error})") from None
    if vertices == 0 or not len(times) or points[0] < len(times) * vertices:
        raise MeshFileError(
            f"{path}: {points[0]} points do not make {len(times)} frames of {vertices} vertices"
        )
    if len(connectivity) % 3 or (len(connectivity) and connectivity.max() >= vertices):
        raise MeshFileError(f"{path}: its polygons are no triangles over {vertices} vertices")
    return MeshSeries(path, connectivity.reshape(-1, 3), times, vertices, fields)
