"""Losses against simulated vertices: squared distances of posed ones, or L1 of unposed offsets in two bands.

    vertices: mean over vertices of |x - x_simulated|^2                              [cm^2] (VertexTargets)
    low, high: mean over vertices of |offset - simulated offset|_1 in each band      [cm]   (BandTargets)

The first trains the supervised baseline, SNUG's own network, and Santesteban 2019; the second TailorNet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import h5py
import numpy as np
import torch
from torch import Tensor

from reference_sim.geometry.topology import edge_uses
from snug.body.skinning import skin, unskin
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import GarmentNetwork
from snug.networks.tailornet import FrequencyMixture
from snug.training.device import CPU

if TYPE_CHECKING:
    from snug.training.training_set import Batch

CM2_PER_M2 = 1e4
CM_PER_M = float(np.sqrt(CM2_PER_M2))
SMOOTHING_SHARE = 0.15  # of the way to the neighbours' mean, in one sweep
SMOOTHING_SWEEPS = 80  # at 1000 vertices


class TargetError(ValueError):
    """Simulated vertices that do not fit the motions: the message names the motion and what differs."""


def vertex_loss(x: Tensor, target: Tensor) -> Tensor:
    """Return the mean squared distance (N, T) [cm^2] of vertices (N, T, V, 3) [m] from their targets."""
    return CM2_PER_M2 * (x - target).square().sum(-1).mean(-1)


def band_loss(predicted: Tensor, target: Tensor) -> Tensor:
    """Return the mean L1 distance (N, T) [cm] of one band, (N, T, V, 3) [m], from its target."""
    return CM_PER_M * (predicted - target).abs().sum(-1).mean(-1)


@dataclass(frozen=True)
class StoredVertices:
    """Simulated vertices (T, V, 3) [m] relative to the pelvis, float32 in an HDF5 file.

    Attributes:
        path: the file.
        shape: expected, (T, V, 3).
        content: digest of them, which tells them from others.
        place: in the file.
    """

    path: Path
    shape: tuple[int, int, int]
    content: str
    place: str

    def read(self, frames: slice, motion: str) -> Tensor:
        """Read those frames. Raises TargetError for a file that does not hold them, or no finite numbers."""
        try:
            with h5py.File(self.path) as file:
                whole = file[self.place]
                shape, dtype = whole.shape, whole.dtype
                positions = whole[frames] if shape == self.shape else np.empty(0)
        except (OSError, ValueError, KeyError, AttributeError, RuntimeError) as error:
            raise TargetError(f"{self.path}: {motion}: {' '.join(str(error).split())[:200]}") from None
        if shape != self.shape or dtype != np.float32:
            raise TargetError(f"{self.path}: {motion}: {shape} of {dtype}, expected {self.shape} of float32")
        _check_finite(positions, motion, frames.start or 0)
        return torch.from_numpy(positions)


# Simulated vertices of one motion: world positions (T, V, 3) [m] in memory, or still in their file.
Targets = np.ndarray | StoredVertices


class StoredFrames:
    """The frames of several files in a row, read when they are asked for."""

    def __init__(self, motions: Sequence[Motion], parts: Sequence[StoredVertices]) -> None:
        self.names, self.parts = [motion.name for motion in motions], parts
        self.first = np.cumsum([0, *(part.shape[0] for part in parts)])
        self.device = CPU

    @property
    def fingerprint(self) -> bytes:
        """Digest input, equal for the same files."""
        return repr([[name, part.content, part.shape] for name, part in zip(self.names, self.parts)]).encode()

    def to(self, device: torch.device) -> StoredFrames:
        """Return itself, giving tensors on that device from now on."""
        self.device = device
        return self

    def __getitem__(self, frames: Tensor) -> Tensor:
        """Read windows of consecutive frames of one motion each, row numbers (N, T) -> (N, T, V, 3) [m]."""
        return torch.stack([self._window(int(row[0]), len(row)) for row in frames]).to(self.device)

    def _window(self, first: int, count: int) -> Tensor:
        part = int(np.searchsorted(self.first, first, side="right")) - 1
        start = first - int(self.first[part])
        return self.parts[part].read(slice(start, start + count), self.names[part])


class VertexTargets:
    """Simulated vertices (F, V, 3) [m] relative to the pelvis, all training frames in a row.

    Where all of them are StoredVertices they stay in their files, and each batch reads its own: the numbers
    are those of trajectories in memory, bit for bit.

    Args:
        dressed: body and garment.
        motions: whose frames stand in a row.
        trajectories: motion name -> simulated vertices.
        weights: skinning weights (V, J) of the prediction.
        transforms: joint transforms (F, J, 3, 4) of all frames.

    Raises:
        TargetError: for a motion without a fitting trajectory.
    """

    unit = "cm²"  # of the loss
    from_files = True  # whether a batch needs nothing but its own frames

    def __init__(
        self,
        dressed: DressedBody,
        motions: Sequence[Motion],
        trajectories: Mapping[str, Targets] | None,
        weights: Tensor,
        transforms: Tensor,
    ) -> None:
        targets = match_targets(motions, trajectories, dressed.vertices)
        self.weights, self.transforms = weights, transforms
        stored = [target for target in targets if isinstance(target, StoredVertices)]
        self.vertices: Tensor | StoredFrames
        if self.from_files and len(stored) == len(targets):
            self.vertices = StoredFrames(motions, stored)
        else:
            self.vertices = load_relative(dressed, motions, targets)

    def to(self, device: torch.device) -> VertexTargets:
        """Move every tensor to the device; return itself."""
        for name, value in vars(self).items():
            if isinstance(value, Tensor | StoredFrames):
                setattr(self, name, value.to(device))
        return self

    def fingerprint(self) -> bytes:
        """Return bytes that are equal for equal vertices in the same place: in memory, or in files."""
        if isinstance(self.vertices, Tensor):
            return self.vertices.cpu().numpy().tobytes()
        return self.vertices.fingerprint

    def terms(
        self,
        network: GarmentNetwork,
        batch: Batch,
        state: Tensor | None,
        posed_by: Callable[..., Tensor] = skin,
    ) -> dict[str, Tensor]:
        """Return parts of the loss of each window and frame, name -> (N, T). posed_by: skin, or its equal."""
        offsets, _ = network(batch.features, state)
        x = posed_by(offsets + batch.rest, self.weights, batch.transforms)
        return {"vertices": vertex_loss(x, self.vertices[torch.as_tensor(batch.frames)])}


class BandTargets(VertexTargets):
    """Simulated vertices, unposed and taken apart into two bands; arguments as for VertexTargets.

    All of it is in memory, also of trajectories in files: smoothing a batch takes longer than its step.
    """

    unit = "cm"
    from_files = False

    def __init__(
        self,
        dressed: DressedBody,
        motions: Sequence[Motion],
        trajectories: Mapping[str, Targets] | None,
        weights: Tensor,
        transforms: Tensor,
    ) -> None:
        super().__init__(dressed, motions, trajectories, weights, transforms)
        assert isinstance(self.vertices, Tensor)
        offsets = unskin(self.vertices, self.weights, self.transforms) - dressed.rest()
        low = smooth_offsets(offsets.numpy(), np.asarray(dressed.garment.faces))
        self.low = torch.as_tensor(low, dtype=torch.float32)
        self.high = offsets - self.low

    def terms(
        self,
        network: GarmentNetwork,
        batch: Batch,
        state: Tensor | None,
        posed_by: Callable[..., Tensor] = skin,
    ) -> dict[str, Tensor]:
        """Return the loss of both bands of the unposed offsets, name -> (N, T)."""
        rows = torch.as_tensor(batch.frames)
        low, high = cast(FrequencyMixture, network).bands(batch.features, state)
        return {"low": band_loss(low, self.low[rows]), "high": band_loss(high, self.high[rows])}


def smooth_offsets(offsets: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the low band of offsets (T, V, 3) [m]: diffused by sweeps with the uniform Laplacian.

    A vertex of an opening moves towards its neighbours along the opening alone, so that openings do not
    shrink. Sweeps in proportion to the vertices reach the same length on any mesh. The rest shape, which no
    band holds, is not smoothed.
    """
    from scipy.sparse import coo_array, diags_array  # a network of another kind trains without scipy

    count = offsets.shape[1]
    edges, uses = edge_uses(faces)
    on_rim = np.zeros(count, dtype=bool)
    on_rim[edges[uses == 1]] = True
    pairs = np.concatenate([edges, edges[:, ::-1]])
    rim = np.concatenate([uses == 1] * 2)
    pairs = pairs[rim | ~on_rim[pairs[:, 0]]]
    near = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()
    mean = diags_array(1.0 / near.sum(axis=1)) @ near
    flat = np.ascontiguousarray(offsets.transpose(1, 0, 2)).reshape(count, -1)
    for _ in range(max(1, round(SMOOTHING_SWEEPS * count / 1000))):
        flat = (1 - SMOOTHING_SHARE) * flat + SMOOTHING_SHARE * (mean @ flat)
    return flat.reshape(count, len(offsets), 3).transpose(1, 0, 2)


def load_relative(dressed: DressedBody, motions: Sequence[Motion], parts: Sequence[Targets]) -> Tensor:
    """Return the vertices of all frames of all motions, (F, V, 3) [m], relative to the pelvis.

    Raises TargetError for a number that is not finite.
    """
    relative = []
    for motion, part in zip(motions, parts):
        if isinstance(part, StoredVertices):
            relative.append(part.read(slice(None), motion.name))
            continue
        _check_finite(part, motion.name)
        relative.append(torch.as_tensor(part - dressed.pelvis(motion)[:, None]).float())
    return torch.cat(relative)


def match_targets(
    motions: Sequence[Motion], trajectories: Mapping[str, Targets] | None, vertices: int
) -> list[Targets]:
    """Return the simulated vertices of each motion.

    Raises TargetError for a missing or unfit one.
    """
    if not trajectories:
        raise TargetError("supervised training needs trajectories: a simulation of each training motion")
    matched: list[Targets] = []
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
        matched.append(positions)
    return matched


def _check_finite(positions: np.ndarray, motion: str, first: int = 0) -> None:
    if not np.isfinite(positions).all():
        frame = first + int(np.argwhere(~np.isfinite(positions).all(axis=(1, 2)))[0, 0])
        raise TargetError(f"trajectory of motion {motion!r} is not finite at frame {frame}")
