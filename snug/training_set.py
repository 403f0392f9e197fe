"""All frames of the training motions in a row, the sub-sequences cut from them, and their contact anchors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from snug.contact import Anchors, Patch
from snug.dresser import DressedBody
from snug.recipe import Recipe
from snug.skinning import joint_transforms, skin

STD_FLOOR = 0.05  # an input that hardly moved in training must not explode on a motion where it does


class TrainingError(ValueError):
    """Training that cannot start or go on; the message names the cause."""


@dataclass
class Batch:
    """Sub-sequences of one step. frames (N, T) are row numbers of the training set."""

    frames: np.ndarray
    features: Tensor  # (N, T, D)
    rest: Tensor  # (N, 1, V, 3) or (V, 3) [m], the unposed garment
    transforms: Tensor  # (N, T, 24, 3, 4)
    ahead: Tensor  # (N, T, 3) [m]


class TrainingSet:
    """Motions made ready for one recipe. Raises TrainingError when no motion is long enough for a window."""

    def __init__(
        self, dressed: DressedBody, motions: Sequence[Any], recipe: Recipe, *, features: str, sequences: bool
    ) -> None:
        """features: see DressedBody.features; sequences: False for a static network, whose frames need no
        past.
        """
        rates = {float(motion.fps) for motion in motions}
        if len(rates) != 1:
            raise TrainingError(
                f"training motions need one frame rate, these have {sorted(rates)}: resample them"
            )
        self.dt = 1.0 / rates.pop()
        self.dressed, self.recipe = dressed, recipe
        self.names = [motion.name for motion in motions]
        self.first = np.cumsum([0, *(len(motion.poses) for motion in motions)])
        self.features = torch.cat([dressed.features(m, recipe, kind=features) for m in motions])
        self.transforms = torch.cat([dressed.transforms(m.poses) for m in motions])
        self.ahead = torch.cat([_ahead(dressed.pelvis(m)) for m in motions])
        self.window = recipe.window if sequences else 1
        self.starts = np.concatenate(
            [
                np.arange(first, first + len(motion.poses) - self.window + 1, recipe.window_stride)
                for first, motion in zip(self.first, motions)
            ]
        )
        if len(self.starts) == 0:
            raise TrainingError(f"no training motion has {self.window} frames: give longer motions")

    @property
    def frames(self) -> int:
        return int(self.first[-1])

    def where(self, frame: int) -> str:
        """A row number in words a user can look up."""
        motion = int(np.searchsorted(self.first, frame, side="right")) - 1
        return f"motion {self.names[motion]!r} frame {frame - self.first[motion]}"

    def input_statistics(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and spread (D,) of the inputs; of the shape numbers those of the recipe's U(-r, r)."""
        mean, std = self.features.mean(0).numpy(), self.features.std(0).numpy()
        std = np.maximum(std, STD_FLOOR)
        shapes = self.dressed.body.shape_count
        if self.recipe.shape_range and self.features.shape[1] > 72:
            mean[-shapes:], std[-shapes:] = 0.0, self.recipe.shape_range / np.sqrt(3.0)
        return mean, std

    def batch(self, windows: np.ndarray, betas: np.ndarray | None) -> Batch:
        """Windows (N,) as tensors, each on a body of its own shape, betas (N, 10), or all on the mean
        body.
        """
        frames = self.starts[windows][:, None] + np.arange(self.window)
        rows = torch.as_tensor(frames)
        features, transforms = self.features[rows], self.transforms[rows]
        if betas is None:
            return Batch(frames, features, self.dressed.rest(), transforms, self.ahead[rows])
        shapes = torch.as_tensor(betas, dtype=torch.float32)
        features = torch.cat(
            [features[..., : -shapes.shape[1]], shapes[:, None].expand(-1, self.window, -1)], -1
        )
        rest = self.dressed.rest(betas)[:, None]
        transforms = self._reshaped(transforms, betas)
        return Batch(frames, features, rest, transforms, self.ahead[rows])

    def _reshaped(self, transforms: Tensor, betas: np.ndarray) -> Tensor:
        """The same poses on other skeletons: rotations are read back from the transforms of the mean body."""
        body = self.dressed.body
        joints = torch.as_tensor(np.stack([body.joints(row) for row in betas]))[:, None]  # (N, 1, 24, 3)
        world = transforms[..., :3].double()
        parents = torch.tensor([max(parent, 0) for parent in self.dressed.parents])
        relative = world[:, :, parents].transpose(-1, -2) @ world
        relative[:, :, 0] = world[:, :, 0]
        home = (-joints[..., 0, :]).expand(*transforms.shape[:2], 3)
        joints = joints.expand(*transforms.shape[:2], *joints.shape[-2:])
        return joint_transforms(relative, joints, self.dressed.parents, home).float()


def _ahead(pelvis: np.ndarray) -> Tensor:
    """2 p_{t-1} - p_{t-2} - p_t of each frame, (T, 3) [m]; zero where two earlier frames are missing."""
    ahead = np.zeros_like(pelvis)
    ahead[2:] = 2 * pelvis[1:-1] - pelvis[:-2] - pelvis[2:]
    return torch.as_tensor(ahead, dtype=torch.float32)


class TrainingContact:
    """Contact planes of batches of a training set, from anchors that are renewed as the network learns."""

    def __init__(self, data: TrainingSet, samples: np.ndarray, *, refresh: float, one_shape: bool) -> None:
        """samples: (S, 3) [m] contact samples of the garment at rest. refresh: see Recipe.contact_refresh.

        one_shape: all on the mean body, which is then posed once for all frames.
        """
        body = data.dressed.body
        self.data, self.refresh = data, refresh
        self.patch = Patch.around(samples, body.shaped(), body.faces)
        self.anchors = Anchors(self.patch, data.frames)
        self.weights = torch.as_tensor(body.skinning_weights[self.patch.body_vertices], dtype=torch.float32)
        self._mean_shape: tuple[np.ndarray, np.ndarray] | None = None
        if one_shape:
            self._mean_shape = self._posed_everywhere()
        self._credit = 0.0

    def _posed_everywhere(self) -> tuple[np.ndarray, np.ndarray]:
        """Patch positions and normals (F, P, 3) of every frame: one body shape, computed once."""
        rest = torch.as_tensor(self.patch.rest)
        corners = torch.cat([rest, torch.ones(len(rest), 1)], 1)  # (P, 4)
        # sum_j w_pj T_j (p, 1) as one matrix product over (j, 4): several times faster than blending first.
        spread = (self.weights[:, :, None] * corners[:, None]).flatten(1)  # (P, 96)
        positions = np.empty((self.data.frames, *rest.shape), np.float32)
        for frame, transform in enumerate(self.data.transforms):
            positions[frame] = (spread @ transform.transpose(-1, -2).flatten(0, 1)).numpy()
        return positions, self.patch.normals(positions)

    def posed(self, batch: Batch, betas: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """rows (N T,) into positions and normals (R, P, 3) of the patch for the frames of a batch."""
        flat = batch.frames.ravel()
        if self._mean_shape is not None:
            return flat, *self._mean_shape
        assert betas is not None
        body, vertices = self.data.dressed.body, self.patch.body_vertices
        shapes = torch.as_tensor(
            body.template[vertices] + np.einsum("vis,ns->nvi", body.shape_directions[vertices], betas),
            dtype=torch.float32,
        )
        positions = skin(shapes[:, None], self.weights, batch.transforms).flatten(0, 1).numpy()
        return np.arange(len(flat)), positions, self.patch.normals(positions)

    def planes(
        self, batch: Batch, posed: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points and normals (N, T, S, 3) from the remembered anchors."""
        points, normals = self.anchors.planes(batch.frames.ravel(), *posed)
        shape = (*batch.frames.shape, *points.shape[1:])
        return points.reshape(shape), normals.reshape(shape)

    def renew(
        self, batch: Batch, posed: tuple[np.ndarray, np.ndarray, np.ndarray], x: Tensor, sample_matrix: Any
    ) -> None:
        """Search the longest-kept anchors of the batch anew from predicted vertices x (N, T, V, 3)."""
        frames, (rows, positions, _) = batch.frames.ravel(), posed
        self._credit += self.refresh * len(frames)
        count = int(self._credit)
        self._credit -= count
        vertices = x.detach().flatten(0, 1)
        for place in self.anchors.oldest(frames, count):
            samples = (sample_matrix @ vertices[place].numpy()).astype(np.float32)
            self.anchors.renew(int(frames[place]), samples, positions[rows[place]])
