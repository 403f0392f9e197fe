"""What a simulation teaches a network that learns from the energies: where the cloth was before.

Inertia asks where the cloth would be if nothing but its own velocity moved it, x_hat = 2 x_{t-1} - x_{t-2}. A
network that gives the frames t-1 and t-2 itself makes them agree with a still present: what costs no energy
is to hang still. So the two frames are a simulation's, and the loss of frame t is what the simulator
minimised in that frame,

    E(x) = strain + bending + gravity + collision + 1/(2 dt^2) (x - x_hat)^T M (x - x_hat)         [J]

with x the network's frame. Its minimum is the next frame of the simulation. That is not the same as to fit
vertices: a network that knows only how the body moved cannot tell every wrinkle, and the mean of many
wrinkles is stretched cloth, for which the strain charges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from snug.baselines.supervised import matched_targets
from snug.training_set import Batch, TrainingSet


class SimulatedPast:
    """x_hat of the training frames; those after the simulated motions' (F', V, 3) are asked for no inertia.

    A simulation begins at rest. Raises TargetError for a motion without a fitting trajectory.
    """

    def __init__(
        self, data: TrainingSet, motions: Sequence[Any], trajectories: Mapping[str, np.ndarray] | None
    ) -> None:
        dressed = data.dressed
        targets = matched_targets(motions, trajectories, dressed.vertices)
        rows = [_ahead_of(x) - dressed.pelvis(m)[:, None] for x, m in zip(targets, motions)]
        self.x_hat = torch.as_tensor(np.concatenate(rows), dtype=torch.float32, device=data.device)
        masses = torch.as_tensor(dressed.cloth.masses, dtype=torch.float32, device=data.device)
        self.stiffness = masses[:, None] / data.dt**2  # (V, 1) [N/m]

    def inertia(self, x: Tensor, batch: Batch) -> Tensor:
        """Joules (N, T) of vertices x (N, T, V, 3) [m] relative to the pelvis."""
        rows = torch.as_tensor(batch.frames, device=x.device)
        known = rows < len(self.x_hat)
        away = x - self.x_hat[rows.clamp(max=len(self.x_hat) - 1)]
        return 0.5 * (self.stiffness * away.square()).sum((-1, -2)) * known


def _ahead_of(x: np.ndarray) -> np.ndarray:
    """x_hat of each frame of a trajectory (T, V, 3) that rests before it begins."""
    before = np.concatenate([x[:1], x[:1], x])
    return 2 * before[1:-1] - before[:-2]
