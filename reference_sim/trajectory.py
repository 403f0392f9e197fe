"""Trajectory: positions over time, whether and how they converged, and its files.

The file is VTKHDF (temporal PolyData), so ParaView opens it as it is; what VTK has no place for lies in
the top-level group /benchmark. Blender's Mesh Cache modifier reads a point cache, PC2: a header, then
float32 positions, sample by sample. PC16 is the same in float16.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.files.atomic_files import replacing
from reference_sim.given_files import demand_file

if TYPE_CHECKING:
    import h5py

PACKED: dict[str, Any] = {"compression": 1, "shuffle": True}  # by gzip


class TrajectoryError(ValueError):
    """Trajectory file that cannot be read; the message names file and remedy."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Positions of one cloth over time.

    status: "converged", or the worst failure among the frames ("diverged", then "timeout", then "stalled"
    or "max_iterations"), of which the reason tells the first; "ok" for a method that does not minimise.

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

    positions: np.ndarray  # (T, V, 3) [m]
    faces: np.ndarray  # (F, 3)
    times: np.ndarray  # (T,) [s]
    # (T,) time on the clock for each frame [s], 0 for a start; nan where none was taken, as by default
    frame_seconds: np.ndarray = field(default_factory=lambda: np.empty(0))
    status: str = "ok"
    reason: str = ""
    provenance: dict[str, Any] = field(default_factory=dict)  # what made it (JSON values)
    frame_fields: dict[str, np.ndarray] = field(default_factory=dict)  # further numbers, each (T,)

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
        """Write the file, whole or not at all; what was there before stays until then."""
        import h5py

        # In memory first: HDF5 crashes where it finds no room on the disk.
        with h5py.File("trajectory", "w", driver="core", backing_store=False) as file:
            _write_vtk(file, self)
            _write_benchmark(file, self)
            file.flush()
            image = file.id.get_file_image()
        with replacing(Path(path)) as temporary:
            temporary.write_bytes(image)

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Read a file of this project. Raises TrajectoryError: it is missing, or no trajectory."""
        try:
            return _read(Path(path))
        except FileNotFoundError:
            raise TrajectoryError(f"{path}: no such trajectory file") from None
        except Exception as error:  # whatever h5py and numpy raise for a damaged file
            reason = " ".join(str(error).split())
            raise TrajectoryError(f"{path}: not a VTKHDF trajectory of this project ({reason})") from None

    def finite(self) -> Trajectory:
        """Return the frames before the first in which a position is not finite."""
        mask = np.isfinite(self.positions).all(axis=(1, 2))
        count = len(mask) if mask.all() else int(np.argmin(mask))
        return replace(
            self, positions=self.positions[:count], times=self.times[:count],
            frame_seconds=self.frame_seconds[:count],
            frame_fields={name: values[:count] for name, values in self.frame_fields.items()},
        )  # fmt: skip


def _read(path: Path) -> Trajectory:
    """Read a file. Raises an exception of any kind for one that is no trajectory or is damaged."""
    import h5py

    with h5py.File(demand_file(path), "r") as file:
        benchmark, vtk = file["benchmark"], file["VTKHDF"]
        provenance = json.loads(benchmark.attrs["provenance"])
        if not isinstance(provenance, dict):
            raise ValueError("its provenance is no JSON object")
        fields = benchmark["frame_fields"]
        vertices = int(vtk["NumberOfPoints"][0])
        trajectory = Trajectory(
            positions=vtk["Points"][:].reshape(-1, vertices, 3),
            faces=vtk["Polygons/Connectivity"][:].reshape(-1, 3),
            times=vtk["Steps/Values"][:],
            frame_seconds=benchmark["frame_seconds"][:],
            status=str(benchmark.attrs["status"]),
            reason=str(benchmark.attrs["reason"]),
            provenance=provenance,
            frame_fields={name.replace(":", "/"): fields[name][:] for name in fields},
        )
    of_frames = trajectory.times, trajectory.frame_seconds, *trajectory.frame_fields.values()
    if {len(values) for values in of_frames} != {trajectory.frames}:
        raise ValueError("its numbers are not of as many frames as its positions")
    if not np.isin(trajectory.faces, np.arange(vertices)).all():
        raise ValueError("its faces name vertices that are not there")
    return trajectory


def _write_benchmark(file: h5py.File, trajectory: Trajectory) -> None:
    """Write what VTK has no place for."""
    benchmark = file.create_group("benchmark")
    benchmark.attrs.update(
        status=trajectory.status,
        reason=trajectory.reason,
        provenance=json.dumps(trajectory.provenance, default=lambda number: number.tolist()),
    )
    benchmark["frame_seconds"] = np.asarray(trajectory.frame_seconds, dtype="f8")
    fields = benchmark.create_group("frame_fields")
    for name, values in trajectory.frame_fields.items():
        # An energy's name has a slash in it; HDF5 would make a group of that.
        fields[name.replace("/", ":")] = np.asarray(values, dtype="f8")


def _write_vtk(file: h5py.File, trajectory: Trajectory) -> None:
    """Write the groups VTK's reader insists on, for one moving PolyData with fixed faces."""
    frames, count, _ = trajectory.positions.shape
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 3], dtype="i8")
    root.attrs.create("Type", b"PolyData", dtype="S8")
    root["NumberOfPoints"] = np.array([count], dtype="i8")
    root.create_dataset(
        "Points", data=np.asarray(trajectory.positions, dtype="f8").reshape(-1, 3), maxshape=(None, 3),
        chunks=(count, 3), **PACKED,  # also of no frames
    )  # fmt: skip
    for name in ("Vertices", "Lines", "Polygons", "Strips"):
        cells = trajectory.faces if name == "Polygons" else np.zeros((0, 3))
        group = root.create_group(name)
        group["NumberOfCells"] = np.array([len(cells)], dtype="i8")
        group["NumberOfConnectivityIds"] = np.array([np.size(cells)], dtype="i8")
        offsets = np.arange(len(cells) + 1, dtype="i8") * 3
        group.create_dataset("Connectivity", data=np.asarray(cells, dtype="i8").ravel(), **PACKED)
        group.create_dataset("Offsets", data=offsets, **PACKED)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = frames
    steps["Values"] = np.asarray(trajectory.times, dtype="f8")
    steps["PointOffsets"] = np.arange(frames, dtype="i8") * count
    steps["PartOffsets"] = np.zeros(frames, dtype="i8")
    steps["NumberOfParts"] = np.ones(frames, dtype="i8")
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((frames, 4), dtype="i8")


SIGNATURE = b"POINTCACHE2\0"
# Signature, version, number of points, first frame, frames a sample, number of samples.
HEADER = np.dtype("S12, <i4, <i4, <f4, <f4, <i4")
TYPES = {".pc2": "<f4", ".pc16": "<f2"}


def write_point_cache(path: str | Path, trajectory: Trajectory) -> tuple[Path, Path]:
    """Write PC2 [m, y up, float32] at `path` and the first frame as OBJ beside it; return both paths.

    Each file is written whole or not at all.
    """
    path = Path(path)
    mesh = path.with_suffix(".obj")
    frames, points, _ = trajectory.positions.shape
    header = np.array((SIGNATURE, 1, points, 0.0, 1.0, frames), HEADER).tobytes()
    with replacing(path) as temporary:
        temporary.write_bytes(header + trajectory.positions.astype("<f4").tobytes())
    write_obj(mesh, trajectory.positions[0], trajectory.faces)
    return path, mesh


def write_obj(path: Path, positions: np.ndarray, faces: np.ndarray, uv: np.ndarray | None = None) -> None:
    """Write vertices (V,3) [m, y up] with all digits and faces (F,3), whole or not at all.

    uv: (V,2) of the vertices, or (F,3,2) of the corners.
    """
    lines = ["# metres, y up", *(f"v {x!r} {y!r} {z!r}" for x, y, z in positions.tolist())]
    polygons = [[f"{vertex}" for vertex in face] for face in (faces + 1).tolist()]
    if uv is not None:
        lines += [f"vt {u!r} {v!r}" for u, v in uv.reshape(-1, 2).tolist()]
        chart = faces if uv.ndim == 2 else np.arange(faces.size).reshape(-1, 3)
        polygons = [[f"{v}/{t}" for v, t in zip(*pair)] for pair in zip(polygons, (chart + 1).tolist())]
    lines += [" ".join(["f", *face]) for face in polygons]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_point_cache(path: str | Path) -> np.ndarray:
    """Read positions (T, V, 3) of a .pc2 (float32) or .pc16 (float16) file, in its unit and axes.

    Raises TrajectoryError: no such file, no point cache, or not as long as its header says.
    """
    path = Path(path)
    if not path.is_file():
        raise TrajectoryError(f"{path}: no such file")
    if path.suffix.lower() not in TYPES:
        raise TrajectoryError(f"{path}: a point cache is named {' or '.join(TYPES)}")
    kind, length = np.dtype(TYPES[path.suffix.lower()]), path.stat().st_size
    if length < HEADER.itemsize:
        raise TrajectoryError(f"{path}: is shorter than the header of a point cache")
    signature, version, points, _, _, frames = np.fromfile(path, HEADER, 1)[0].tolist()
    declared = HEADER.itemsize + frames * points * 3 * kind.itemsize
    if (signature, version) != (SIGNATURE[:-1], 1) or min(points, frames) < 1 or declared != length:
        raise TrajectoryError(
            f"{path}: {signature!r} of version {version}, {frames} samples of {points} points take "
            f"{declared} bytes, the file has {length}: write it again"
        )
    return np.fromfile(path, kind, offset=HEADER.itemsize).reshape(frames, points, 3)
