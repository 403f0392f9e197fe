"""The supervised baseline: SNUG's own network, taught by the vertices of a simulation instead of by physics.

loss = mean over frames and vertices of |x - x_simulated|^2     [cm^2]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

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

    weights (V, J) and transforms (F, J, 3, 4) are those that skin the prediction. Raises TargetError for a
    motion without a fitting trajectory.
    """

    def __init__(
        self,
        dressed: Any,
        motions: Sequence[Any],
        trajectories: Mapping[str, np.ndarray] | None,
        weights: Tensor,
        transforms: Tensor,
    ) -> None:
        targets = matched_targets(motions, trajectories, dressed.vertices)
        pelvis = [dressed.pelvis(motion) for motion in motions]
        self.weights, self.transforms = weights, transforms
        self.vertices = torch.cat([torch.as_tensor(t - p[:, None]).float() for t, p in zip(targets, pelvis)])

    def to(self, device: torch.device) -> VertexTargets:
        """Itself, with every tensor moved to the device."""
        for name, value in vars(self).items():
            if isinstance(value, Tensor):
                setattr(self, name, value.to(device))
        return self

    def terms(self, network: Any, batch: Batch, state: Any) -> dict[str, Tensor]:
        """Parts of the loss of each window and frame, name -> (N, T)."""
        offsets, _ = network(batch.features, state)
        x = skin(batch.rest + offsets, self.weights, batch.transforms)
        return {"vertices": vertex_loss(x, self.vertices[torch.as_tensor(batch.frames)])}


def matched_targets(
    motions: Sequence[Any], trajectories: Mapping[str, np.ndarray] | None, vertices: int
) -> list[np.ndarray]:
    """One (T, V, 3) array [m, world] for each motion. Raises TargetError for a missing or unfit one."""
    if not trajectories:
        raise TargetError("supervised training needs trajectories: a simulation of each training motion")
    found = []
    for motion in motions:
        if motion.name not in trajectories:
            raise TargetError(
                f"no simulated trajectory for motion {motion.name!r}: simulate it, or leave it out"
            )
        positions = np.asarray(trajectories[motion.name])
        expected = (motion.frames, vertices, 3)
        if positions.shape != expected:
            raise TargetError(
                f"trajectory of motion {motion.name!r} has shape {positions.shape}, expected {expected}"
            )
        if not np.isfinite(positions).all():
            frame = int(np.argwhere(~np.isfinite(positions).all(axis=(1, 2)))[0, 0])
            raise TargetError(f"trajectory of motion {motion.name!r} is not finite at frame {frame}")
        found.append(positions)
    return found
