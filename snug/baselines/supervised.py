"""The supervised baseline: SNUG's own network, taught by the vertices of a simulation instead of by physics.

loss = mean over frames and vertices of |x - x_simulated|^2     [cm^2]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.trajectory import Positions, StoredPositions
from snug.device import CPU
from snug.skinning import skin

if TYPE_CHECKING:
    from snug.training_set import Batch

CM2_PER_M2 = 1e4


class TargetError(ValueError):
    """Simulated vertices that do not fit the motions: the message names the motion and what differs."""


def vertex_loss(x: Tensor, target: Tensor) -> Tensor:
    """x, target (N, T, V, 3) [m] -> (N, T) [cm^2]."""
    return CM2_PER_M2 * (x - target).square().sum(-1).mean(-1)


class VertexTargets:
    """What a simulation teaches: vertices (F, V, 3) [m] relative to the pelvis, all training frames in a row.

    Where all trajectories are StoredPositions the vertices stay in their files, and each batch reads its own:
    the numbers are those of trajectories in memory, bit for bit.

    weights (V, J) and transforms (F, J, 3, 4) are those that skin the prediction. Raises TargetError for a
    motion without a fitting trajectory.
    """

    from_files = True  # whether a batch needs nothing but its own frames

    def __init__(
        self,
        dressed: Any,
        motions: Sequence[Any],
        trajectories: Mapping[str, Positions] | None,
        weights: Tensor,
        transforms: Tensor,
    ) -> None:
        targets = matched_targets(motions, trajectories, dressed.vertices)
        self.weights, self.transforms = weights, transforms
        if self.from_files and all(isinstance(target, StoredPositions) for target in targets):
            self.vertices: Any = StoredVertices(dressed, motions, targets)
        else:
            self.vertices = all_relative(dressed, motions, targets)

    def to(self, device: torch.device) -> VertexTargets:
        """Itself, with every tensor moved to the device."""
        for name, value in vars(self).items():
            if isinstance(value, Tensor | StoredVertices):
                setattr(self, name, value.to(device))
        return self

    def fingerprint(self) -> bytes:
        """Equal for equal vertices in the same place: in memory, or in files of equal content."""
        if isinstance(self.vertices, Tensor):
            return self.vertices.cpu().numpy().tobytes()
        return self.vertices.fingerprint

    def terms(self, network: Any, batch: Batch, state: Any) -> dict[str, Tensor]:
        """Parts of the loss of each window and frame, name -> (N, T)."""
        offsets, _ = network(batch.features, state)
        x = skin(batch.rest + offsets, self.weights, batch.transforms)
        return {"vertices": vertex_loss(x, self.vertices[torch.as_tensor(batch.frames)])}


class StoredVertices:
    """Rows of files, read when they are asked for: nothing stays in memory but the pelvis."""

    def __init__(self, dressed: Any, motions: Sequence[Any], parts: Sequence[StoredPositions]) -> None:
        self.names, self.parts = [motion.name for motion in motions], parts
        self.pelvis = [dressed.pelvis(motion) for motion in motions]
        self.first = np.cumsum([0, *map(len, parts)])
        self.device = CPU
        said = [[name, part.content, *part.shape] for name, part in zip(self.names, parts)]
        self.fingerprint = repr(said).encode()

    def to(self, device: torch.device) -> StoredVertices:
        """Itself, giving tensors on that device from now on."""
        self.device = device
        return self

    def __getitem__(self, frames: Tensor) -> Tensor:
        """Windows of consecutive frames, row numbers (N, T) -> (N, T, V, 3) [m].

        Raises TargetError for a number that is not finite.
        """
        return torch.stack([self._window(int(row[0]), len(row)) for row in frames]).to(self.device)

    def _window(self, first: int, count: int) -> Tensor:
        part = int(np.searchsorted(self.first, first, side="right")) - 1
        start = first - int(self.first[part])
        frames = slice(start, start + count)
        return relative(self.parts[part][frames], self.pelvis[part][frames], self.names[part], start)


def all_relative(dressed: Any, motions: Sequence[Any], parts: Sequence[Any]) -> Tensor:
    """`relative` of all frames of all motions, (F, V, 3) [m]; one motion at a time is in float64."""
    return torch.cat([relative(part[:], dressed.pelvis(m), m.name) for m, part in zip(motions, parts)])


def relative(positions: np.ndarray, pelvis: np.ndarray, motion: str, first: int = 0) -> Tensor:
    """Vertices (T, V, 3) [m] of a motion from its frame `first` on, in float32, seen from the pelvis (T, 3).

    Raises TargetError for a number that is not finite.
    """
    if not np.isfinite(positions).all():
        frame = first + int(np.argwhere(~np.isfinite(positions).all(axis=(1, 2)))[0, 0])
        raise TargetError(f"trajectory of motion {motion!r} is not finite at frame {frame}")
    return torch.as_tensor(positions - pelvis[:, None]).float()


def matched_targets(
    motions: Sequence[Any], trajectories: Mapping[str, Positions] | None, vertices: int
) -> list[Any]:
    """(T, V, 3) [m, world] for each motion: an array, or what is still in its file.

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
        if not isinstance(positions, StoredPositions):
            positions = np.asarray(positions)
        expected = (motion.frames, vertices, 3)
        if positions.shape != expected:
            raise TargetError(
                f"trajectory of motion {motion.name!r} has shape {positions.shape}, expected {expected}"
            )
        found.append(positions)
    return found
