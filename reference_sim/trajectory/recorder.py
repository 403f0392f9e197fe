"""Recorder of a simulation: frames in memory and, where a path is given, in a file; status of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.minimise.result import Result, severity
from reference_sim.trajectory.resume import PartialRun
from reference_sim.trajectory.trajectory import Trajectory
from reference_sim.trajectory.writer import TrajectoryWriter


class Recorder:
    """Collector of the frames of one simulation; use it in a `with` block.

    Args:
        cloth: gives the faces.
        provenance: JSON values.
        path: VTKHDF file, or None to keep the frames in memory alone.
    """

    def __init__(self, cloth: Cloth, provenance: dict[str, Any], path: str | Path | None) -> None:
        self._faces, self._provenance = cloth.faces, provenance
        self._positions: list[np.ndarray] = []
        self._times: list[float] = []
        self._seconds: list[float] = []
        self._fields: list[dict[str, float]] = []
        self.status, self.reason = "converged", ""
        self._file = None
        if path:
            count = cloth.vertex_count
            self._file = TrajectoryWriter(path, cloth.faces, provenance, vertex_count=count)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        if self._file:
            if kind is None:
                self._file.finish(self.status, self.reason)
            self._file.__exit__(kind, *rest)

    @property
    def frames(self) -> int:
        """Number of frames so far."""
        return len(self._positions)

    def start(self, x: np.ndarray, fields: dict[str, float]) -> None:
        """Add frame 0, x (V, 3) [m], which is given; the file appears."""
        self.add(x, 0.0, 0.0, fields)
        if self._file:
            self._file.go_live()

    def replay(self, earlier: PartialRun) -> None:
        """Add the frames of an earlier run; the file that it left is replaced by a clean one."""
        old = earlier.trajectory
        for k in range(old.frames):
            fields = {name: float(values[k]) for name, values in old.frame_fields.items()}
            before = earlier.before if k == old.frames - 1 else None
            self.add(old.positions[k], float(old.times[k]), float(old.frame_seconds[k]), fields, before)
        if old.reason:
            self._tell(old.status, old.reason)
        if self._file:
            self._file.go_live()

    def note(self, frame: int, results: Sequence[Result]) -> None:
        """Take the status of the whole from the minimisations on the way to `frame`.

        The worst counts, and of equally bad ones the first: a solver that is stopped early gives up in frame
        1, which must not hide a later divergence. Until one did not converge, the reason is that of the first
        that converged within round-off alone.
        """
        for result in results:
            worse = severity(result.status) > severity(self.status)
            if worse or (result.relaxed and not self.reason):
                self._tell(result.status, f"frame {frame}: {result.reason}")

    def _tell(self, status: str, reason: str) -> None:
        self.status, self.reason = status, reason
        if self._file:
            self._file.first_failure(status, reason)

    def add(
        self,
        x: np.ndarray,
        time: float,
        seconds: float,
        fields: dict[str, float],
        before: np.ndarray | None = None,
    ) -> None:
        """Add one frame; the arguments are those of `TrajectoryWriter.append`."""
        self._positions.append(x)
        self._times.append(time)
        self._seconds.append(seconds)
        self._fields.append(fields)
        if self._file:
            self._file.append(x, time, seconds, fields, before=before)

    def trajectory(self) -> Trajectory:
        """Return all frames so far."""
        return Trajectory(
            positions=np.array(self._positions),
            faces=self._faces,
            times=np.array(self._times),
            frame_seconds=np.array(self._seconds),
            status=self.status,
            reason=self.reason,
            provenance=self._provenance,
            frame_fields={k: np.array([f[k] for f in self._fields]) for k in self._fields[0]},
        )
