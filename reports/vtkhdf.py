"""Reads the trajectory files of a run: VTKHDF temporal PolyData, through h5py alone."""

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
            times = np.asarray(root["Steps/Values"], dtype=float)
            connectivity = np.asarray(root["Polygons/Connectivity"], dtype=np.int64)
            points = root["Points"].shape
            fields = _per_frame_fields(file, len(times))
    except (OSError, KeyError, IndexError, ValueError) as error:
        raise MeshFileError(f"{path}: no VTKHDF mesh over time ({error})") from None
    if vertices == 0 or points != (len(times) * vertices, 3):
        raise MeshFileError(
            f"{path}: {points} points do not make {len(times)} frames of {vertices} vertices"
        )
    if len(connectivity) % 3 or (len(connectivity) and connectivity.max() >= vertices):
        raise MeshFileError(f"{path}: its polygons are no triangles over {vertices} vertices")
    return MeshSeries(path, connectivity.reshape(-1, 3), times, vertices, fields)


def _per_frame_fields(file: h5py.File, frames: int) -> dict[str, np.ndarray]:
    """One number per frame, by the last two parts of the name: "energy/strain" wherever it is kept."""
    fields: dict[str, np.ndarray] = {}

    def keep(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset) and item.shape == (frames,) and item.dtype.kind == "f":
            fields["/".join(name.split("/")[-2:])] = np.asarray(item, dtype=float)

    file.visititems(keep)
    return fields
