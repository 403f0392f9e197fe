"""The supervised baseline: SNUG's own network, taught by the vertices of a simulation instead of by physics.

loss = mean over frames and vertices of |x - x_simulated|^2     [cm^2]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from snug.body.skinning import skin
from snug.training.device import CPU

if TYPE_CHECKING:
    from snug.motion.motion import Motion
    from snug.training.training_set import Batch

CM2_PER_M2 = 1e4


class TargetError(ValueError):
    """Simulated vertices that do not fit the motions: the message names the motion and what differs."""


def vertex_loss(x: Tensor, target: Tensor) -> Tensor:
    """x, target (N, T, V, 3) [m] -> (N, T) [cm^2]."""
    return CM2_PER_M2 * (x - target).square().sum(-1).mean(-1)


class VertexTargets:
    """What a simulation teaches: vertices (F, V, 3) [m] relative to the pelvis, all training frames in a row.

    Where all of them are StoredVertices they stay in their files, and each batch reads its own: the numbers
    are those of trajectories in memory, bit for bit.

    weights (V, J) and transforms (F, J, 3, 4) are those that skin the prediction. Raises TargetError for a
    motion without a fitting trajectory.
    """

    unit = "cm²"  # of the loss
    from_files = True  # whether a batch needs nothing but its own frames

    def __init__(
        self,
        dressed: Any,
        motions: Sequence[Motion],
        trajectories: Mapping[str, Targets] | None,
        weights: Tensor,
        transforms: Tensor,
    ) -> None:
        targets = matched_targets(motions, trajectories, dressed.vertices)
        self.weights, self.transforms = weights, transforms
        self.vertices: Tensor | StoredFrames = StoredFrames(motions, targets)
        if not (self.from_files and all(isinstance(target, StoredVertices) for target in targets)):
            self.vertices = all_relative(dressed, motions, targets)

    def to(self, device: torch.device) -> VertexTargets:
        """Itself, with every tensor moved to the device."""
        for name, value in vars(self).items():
            if isinstance(value, Tensor | StoredFrames):
                setattr(self, name, value.to(device))
        return self

    def fingerprint(self) -> bytes:
        """Equal for equal vertices in the same place: in memory, or in files of equal content."""
        if isinstance(self.vertices, Tensor):
            return self.vertices.cpu().numpy().tobytes()
        return self.vertices.fingerprint

    def terms(
        self, network: Any, batch: Batch, state: Any, posed_by: Callable[..., Tensor] = skin
    ) -> dict[str, Tensor]:
        """Parts of the loss of each window and frame, name -> (N, T). posed_by: skin, or what is as good."""
        offsets, _ = network(batch.features, state)
        x = posed_by(offsets + batch.rest, self.weights, batch.transforms)
        return {"vertices": vertex_loss(x, self.vertices[torch.as_tensor(batch.frames)])}


@dataclass(frozen=True)
class StoredVertices:
    """What a simulation teaches, in an .npy file of float32: shape (T, V, 3) [m], seen from the pelvis.

    content: a digest of the file, for who needs to tell it from another. Nothing of it stays in memory.
    """

    path: Path
    shape: tuple[int, int, int]
    content: str = ""

    def read(self, frames: slice, motion: str) -> Tensor:
        """Those frames. Raises TargetError for a file that does not hold them, or no finite numbers."""
        try:
            whole = np.load(self.path, mmap_mode="r", allow_pickle=False)
            found = np.array(whole[frames])
        except (OSError, ValueError, EOFError, SyntaxError) as error:
            raise TargetError(f"{self.path}: {' '.join(str(error).split())[:200]}") from None
        if whole.shape != self.shape or whole.dtype != np.float32:
            raise TargetError(
                f"{self.path}: {whole.shape} of {whole.dtype}, expected {self.shape} of float32"
            )
        _check_finite(found, motion, frames.start or 0)
        return torch.from_numpy(found)


Targets = np.ndarray | StoredVertices


class StoredFrames:
    """The frames of several files in a row, read when they are asked for."""

    def __init__(self, motions: Sequence[Motion], parts: Sequence[Any]) -> None:
        self.names, self.parts = [motion.name for motion in motions], parts
        self.first = np.cumsum([0, *(part.shape[0] for part in parts)])
        self.device = CPU

    @property
    def fingerprint(self) -> bytes:
        """Equal for the same files."""
        return repr([[name, part.content, part.shape] for name, part in zip(self.names, self.parts)]).encode()

    def to(self, device: torch.device) -> StoredFrames:
        """Itself, giving tensors on that device from now on."""
        self.device = device
        return self

    def __getitem__(self, frames: Tensor) -> Tensor:
        """Windows of consecutive frames of one motion each, row numbers (N, T) -> (N, T, V, 3) [m]."""
        return torch.stack([self._window(int(row[0]), len(row)) for row in frames]).to(self.device)

    def _window(self, first: int, count: int) -> Tensor:
        part = int(np.searchsorted(self.first, first, side="right")) - 1
        start = first - int(self.first[part])
        return self.parts[part].read(slice(start, start + count), self.names[part])


def all_relative(dressed: Any, motions: Sequence[Motion], parts: Sequence[Any]) -> Tensor:
    """Vertices of all frames of all motions, (F, V, 3) [m], seen from the pelvis.

    Raises TargetError for a number that is not finite.
    """
    found = []
    for motion, part in zip(motions, parts):
        if isinstance(part, StoredVertices):
            found.append(part.read(slice(None), motion.name))
            continue
        _check_finite(part, motion.name)
        found.append(torch.as_tensor(part - dressed.pelvis(motion)[:, None]).float())
    return torch.cat(found)


def _check_finite(positions: np.ndarray, motion: str, first: int = 0) -> None:
    if not np.isfinite(positions).all():
        frame = first + int(np.argwhere(~np.isfinite(positions).all(axis=(1, 2)))[0, 0])
        raise TargetError(f"trajectory of motion {motion!r} is not finite at frame {frame}")


def matched_targets(
    motions: Sequence[Motion], trajectories: Mapping[str, Targets] | None, vertices: int
) -> list[Any]:
    """For each motion an array (T, V, 3) [m, world], or what is still in its file.

    Raises TargetError for a missing or unfit one.
    """
    if not trajectories:
        raise TargetError("supervised training needs trajectories: a simulation of each training motion")
    found = []
    for motion in motions:
        if motion.name not in trajectories:
            raise TargetError(
                f"no simulated trajectory for motion {motion.name!r}: simulate it, or leave it out"
            )
        positions = trajectories[motion.name]
        if not isinstance(positions, StoredVertices):
            positions = np.asarray(positions)
        expected = (motion.frames, vertices, 3)
        if positions.shape != expected:
            raise TargetError(
                f"trajectory of motion {motion.name!r} has shape {positions.shape}, expected {expected}"
            )
        found.append(positions)
    return found
