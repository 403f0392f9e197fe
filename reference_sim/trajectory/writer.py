"""Writer of a trajectory, frame by frame: after a kill, or on a full disk, the file holds whole frames."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.files.atomic_files import create, reserve

if TYPE_CHECKING:
    import h5py

UNFINISHED = "unfinished"  # status of a file whose writer did not end by itself
# Where the writer keeps what a resumed run needs.
BEFORE_LAST_STEP, FIRST_FAILURE = "before_last_step", "first_failure"
END_OF_FILE = slice(40, 48)  # of the superblock (version 0): where HDF5 believes the file to end
# An index of blocks in the format of HDF5 1.10 grows at its end. In the format before it is a tree whose
# nodes are split, and between two writes of a split no frame can be read. The file itself is made in the
# format before: in that of 1.10 it notes that it is open for writing, and after a kill could not be opened.
INDEX_THAT_GROWS = ("v110", "v110")
ROOM_FOR_HDF5 = 1 << 20  # [bytes] that HDF5 may need beside the numbers of a frame


class TrajectoryWriter:
    """Appends frames to a VTKHDF file; use it in a `with` block.

    The file appears under its name at the end of the block, and only if that ends well; or at `go_live`, and
    from then on a frame counts only once all of it has been flushed: kill -9 leaves the whole frames.

    Args:
        path: the file, replaced if it exists.
        faces: (F, 3).
        provenance: JSON values.
        vertex_count: V.
    """

    def __init__(
        self,
        path: str | Path,
        faces: np.ndarray,
        provenance: dict[str, Any],
        *,
        vertex_count: int,
    ) -> None:
        self.path = Path(path)
        # Where it is written; None once it lies under its name.
        self._part: Path | None = self.path.with_name(self.path.name + ".part")
        self._vertex_count = vertex_count
        self.frames = 0
        self._create(self._part, np.size(faces))
        _vtk_skeleton(self._file, np.asarray(faces, dtype=np.int64), vertex_count)
        benchmark = self._file.create_group("benchmark")
        benchmark.create_group("frame_fields")
        benchmark.create_dataset("frame_seconds", (0,), maxshape=(None,), dtype="f8")
        benchmark.attrs.update(
            {
                "frames": 0,
                "status": UNFINISHED,
                "reason": "the run that wrote this did not end",
                "provenance": json.dumps(provenance),
            }
        )

    def _create(self, path: Path, numbers: int) -> None:
        """Make the file, with room for its faces; where there is no room it is gone again."""
        import h5py

        create(path)
        try:
            reserve(path, 16 * numbers + ROOM_FOR_HDF5)
            h5py.File(path, "w").close()
            self._file = h5py.File(path, "r+", libver=INDEX_THAT_GROWS)
            self._reserve(numbers)
        except OSError:
            path.unlink()
            raise

    def _reserve(self, numbers: int) -> None:
        """Set room aside for so many more numbers and what HDF5 puts around them: without, it crashes.

        Raises:
            OSError: no room; what was written before is then whole.
        """
        reserve(self._part or self.path, self._file.id.get_filesize() + 16 * numbers + ROOM_FOR_HDF5)

    def append(
        self,
        positions: np.ndarray,
        time: float,
        seconds: float = float("nan"),
        fields: dict[str, float] | None = None,
        *,
        before: np.ndarray | None = None,
    ) -> None:
        """Add one frame.

        Args:
            positions: (V, 3) [m].
            time: of the frame [s].
            seconds: on the clock [s].
            fields: further numbers by name.
            before: (2, V, 3) positions [m] and velocity [m/s] from which the last step to this frame was
                made; a run with sub-steps that is resumed from this frame needs them.
        """
        numbers = {name: np.array([value]) for name, value in (fields or {}).items()}
        self.extend(
            np.asarray(positions)[None], np.array([time]), np.array([seconds]), numbers, before=before
        )

    def extend(
        self,
        positions: np.ndarray,
        times: np.ndarray,
        seconds: np.ndarray,
        fields: dict[str, np.ndarray],
        *,
        before: np.ndarray | None = None,
    ) -> None:
        """Add K frames at once.

        Args:
            positions: (K, V, 3) [m].
            times: (K,) [s].
            seconds: (K,) on the clock [s].
            fields: further numbers by name, (K,) each.
            before: as of `append`, for one frame.
        """
        k, count = self.frames, len(positions)
        self._reserve(np.size(positions) + (0 if before is None else 2 * np.size(before)))
        vtk, benchmark = self._file["VTKHDF"], self._file["benchmark"]
        steps = vtk["Steps"]
        # VTK crashes on Values longer than NSteps, so the count is raised first.
        steps.attrs.modify("NSteps", k + count)
        _append(vtk["Points"], np.reshape(positions, (-1, 3)))
        _append(steps["Values"], times)
        _append(steps["PointOffsets"], np.arange(k, k + count) * self._vertex_count)
        _append(steps["PartOffsets"], np.zeros(count, dtype=np.int64))
        _append(steps["NumberOfParts"], np.ones(count, dtype=np.int64))
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            _append(steps[name], np.zeros((count, 4), dtype=np.int64))
        _append(benchmark["frame_seconds"], seconds)
        for name, values in fields.items():
            group = benchmark["frame_fields"]
            # An energy's name has a slash in it; HDF5 would make a group of that.
            key = name.replace("/", ":")
            if key not in group:
                group.create_dataset(key, (0,), maxshape=(None,), dtype="f8", fillvalue=np.nan)
            group[key].resize((k + count,))
            group[key][k:] = values
        if before is not None:
            if BEFORE_LAST_STEP not in benchmark:
                benchmark.create_dataset(BEFORE_LAST_STEP, (2, *np.shape(before)), dtype="f8")
            benchmark[BEFORE_LAST_STEP][k % 2] = (
                before  # the other half still serves the frame before, should this one fail
            )
        self.frames = k + count
        if self._part is None:
            self._file.flush()
        benchmark.attrs.modify("frames", self.frames)  # last: a reader trusts only whole frames
        if self._part is None:
            self._file.flush()

    def go_live(self) -> None:
        """Put the file in place with what it holds, and flush every frame from now on."""
        if self._part is None:
            return
        import h5py

        self._close(self._part)
        os.replace(self._part, self.path)
        self._part = None
        self._file = h5py.File(self.path, "r+", libver=INDEX_THAT_GROWS)

    def first_failure(self, status: str, reason: str) -> None:
        """Note how the frame that is appended next failed, the worst so far, for a run that resumes this."""
        self._file["benchmark"].attrs[FIRST_FAILURE] = json.dumps([status, reason])

    def finish(self, status: str, reason: str) -> None:
        """Write how the run ended."""
        self._file["benchmark"].attrs.update({"status": status, "reason": reason})

    def __enter__(self) -> TrajectoryWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.go_live()
        self._close(self._part or self.path)
        if self._part is not None:
            self._part.unlink()

    def _close(self, path: Path) -> None:
        """Close the file, give back what was set aside and not used, and see it on the disk."""
        self._file.close()
        with path.open("rb+") as file:
            head = file.read(END_OF_FILE.stop)
            os.ftruncate(file.fileno(), int.from_bytes(head[END_OF_FILE], "little"))
            os.fsync(file.fileno())


def _append(dataset: h5py.Dataset, rows: np.ndarray) -> None:
    rows = np.asarray(rows)
    size = dataset.shape[0]
    dataset.resize(size + len(rows), axis=0)
    dataset[size:] = rows


def _vtk_skeleton(file: h5py.File, faces: np.ndarray, vertex_count: int) -> None:
    """Make the groups VTK's reader insists on, for one moving PolyData with fixed faces."""
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 3], dtype="i8")
    root.attrs.create("Type", b"PolyData", dtype="S8")
    root["NumberOfPoints"] = np.array([vertex_count], dtype="i8")
    chunk = (vertex_count, 3)
    root.create_dataset(
        "Points", (0, 3), maxshape=(None, 3), dtype="f8", chunks=chunk, compression=1, shuffle=True
    )
    for name in ("Vertices", "Lines", "Polygons", "Strips"):
        cells = faces if name == "Polygons" else np.zeros((0, 3), dtype=np.int64)
        group = root.create_group(name)
        group["NumberOfCells"] = np.array([len(cells)], dtype="i8")
        group["NumberOfConnectivityIds"] = np.array([cells.size], dtype="i8")
        group["Connectivity"] = cells.ravel()
        group["Offsets"] = np.arange(len(cells) + 1, dtype="i8") * 3
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = 0
    steps.create_dataset("Values", (0,), maxshape=(None,), dtype="f8")
    for name in ("PointOffsets", "PartOffsets", "NumberOfParts"):
        steps.create_dataset(name, (0,), maxshape=(None,), dtype="i8")
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps.create_dataset(name, (0, 4), maxshape=(None, 4), dtype="i8")
