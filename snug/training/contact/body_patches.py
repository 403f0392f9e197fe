"""Bodies in the poses of a training set, as far as one garment may touch them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import torch
from torch import Tensor

from snug.body.skinning import add_pose_correctives, skin
from snug.kernels.skinning import FastSkin
from snug.training.contact.cache import Patch
from snug.training.device import compiled
from snug.training.training_set import Batch, TrainingSet

# Patches in the frames of a batch: rows (N T,) into positions and normals (R, P, 3), arrays or tensors.
Posed = tuple[np.ndarray, Any, Any]
POSED_TOGETHER = 64  # frames whose bodies are posed by one call
MARKED = 25  # every so many vertices of the patch there is a mark


class BodyPatches:
    """The patch of a body in every frame of a training set.

    Args:
        data: the training set.
        patch: the part of its body.
        normals: of positions (N, P, 3) [m], the vertex normals as the cache of anchors takes them.
        kernels: whether arrays are posed by kernels, else tensors on the set's device by torch.
        kept: whether each frame has one body for good; the kernels then pose them all once.
    """

    def __init__(
        self, data: TrainingSet, patch: Patch, normals: Callable[[Any], Any], *, kernels: bool, kept: bool
    ) -> None:
        body, vertices, device = data.dressed.body, patch.body_vertices, data.device
        self.data, self.normals, self.kernels = data, normals, kernels
        self.weights, self.template, self.directions = (
            torch.as_tensor(array[vertices], dtype=torch.float32, device=device)
            for array in (body.skinning_weights, body.template, body.shape_directions)
        )
        self.correctives: Tensor | None = None
        if body.pose_directions is not None:
            correctives = body.pose_directions[vertices]
            self.correctives = torch.as_tensor(correctives, dtype=torch.float32, device=device)
        self._pose = compiled(self._posed_by_torch, device)
        self.kept = self._posed_everywhere() if kept and kernels else None

    def posed(self, batch: Batch) -> Posed:
        """Return the body in the poses of a batch."""
        if self.kept is not None:
            return batch.frames.ravel(), *self.kept
        rows = np.arange(batch.transforms.shape[0] * batch.transforms.shape[1])
        if not self.kernels:
            return rows, *self._pose(self._unposed(batch), batch.transforms)
        # the first frames of all windows, then the second ones
        by_time = rows.reshape(batch.transforms.shape[1::-1]).T.ravel()
        return by_time, *self._posed_by_kernels(self._unposed(batch), batch.transforms)

    @cached_property
    def marks(self) -> np.ndarray:
        """Some vertices of the patch in every frame, (F, M, 3) [m], by which poses are compared."""
        # On the CPU whatever the device, so that processes that share a run propagate alike.
        weights = self.weights[::MARKED].cpu()
        return np.concatenate([
            skin(self._corrected(rest.cpu(), part, MARKED), weights, part).numpy()
            for rest, frames in self._worn()
            for part in self.data.transforms[frames].cpu().split(POSED_TOGETHER)
        ])  # fmt: skip

    def _unposed(self, batch: Batch) -> Tensor:
        """Return the unposed patches of a batch, (P, 3) or one for each window (N, 1, P, 3)."""
        if batch.betas is None:
            return self.template
        # (P, 3, N), as FastSkin reads it
        moved = torch.tensordot(self.directions, batch.betas, ([2], [1]))
        return (self.template[..., None] + moved).permute(2, 0, 1)[:, None]

    def _corrected(self, rest: Tensor, transforms: Tensor, every: int = 1) -> Tensor:
        """Return patch positions (..., P, 3), or every so many of them, with pose correctives."""
        rest = rest[..., ::every, :]
        if self.correctives is None:
            return rest
        parents, directions = self.data.dressed.parents, self.correctives[::every].to(rest.device)
        return add_pose_correctives(rest, directions, transforms, parents)

    def _posed_by_torch(self, rest: Tensor, transforms: Tensor) -> tuple[Tensor, Tensor]:
        """Pose rest (..., P, 3) by transforms (N, T, J, 3, 4); return positions and normals (N T, P, 3)."""
        positions = skin(self._corrected(rest, transforms), self.weights, transforms).flatten(0, 1)
        return positions, self.normals(positions)

    def _posed_by_kernels(self, rest: Tensor, transforms: Tensor) -> tuple[np.ndarray, np.ndarray]:
        """Pose rest (P, 3) or (N, 1, P, 3) by (N, T, J, 3, 4); return positions, normals (T N, P, 3)."""
        points = self._corrected(rest, transforms).expand(*transforms.shape[:2], -1, -1)
        posed = FastSkin.apply(points, self.weights, transforms)
        positions = posed.transpose(0, 1).flatten(0, 1).contiguous().numpy()
        return positions, self.normals(positions)

    def _posed_everywhere(self) -> tuple[np.ndarray, np.ndarray]:
        """Compute patch positions and normals (F, P, 3) of every frame."""
        shape = self.data.frames, *self.template.shape
        positions, normals = np.empty(shape, np.float32), np.empty(shape, np.int8)
        for rest, frames in self._worn():
            for start in range(frames.start, frames.stop, POSED_TOGETHER):
                some = slice(start, min(start + POSED_TOGETHER, frames.stop))
                positions[some], normals[some] = self._posed_by_kernels(
                    rest, self.data.transforms[None, some]
                )
        return positions, normals

    def _worn(self) -> Iterator[tuple[Tensor, slice]]:
        """Yield unposed patches (P, 3) and the frames of each: motion by motion, or one for all frames."""
        shapes, first = self.data.shapes, self.data.first
        if shapes is None:
            yield self.template, slice(0, self.data.frames)
            return
        for betas, start, stop in zip(shapes, first[:-1], first[1:]):
            moved = self.directions @ torch.as_tensor(betas).to(self.directions)
            yield self.template + moved, slice(int(start), int(stop))
