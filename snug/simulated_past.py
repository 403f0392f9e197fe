"""What a simulation teaches a network that learns from the energies: where the cloth was, and where it went.

Inertia asks where the cloth would be if nothing but its own velocity moved it, x_hat = 2 x_{t-1} - x_{t-2}. A
network that gives the frames t-1 and t-2 itself makes them agree with a still present: what costs no energy
is to hang still. So the two frames are those of a simulation, s, and the loss of frame t is what the
simulator minimised in that frame, and a distance that weighs NEARNESS times as much as inertia,

    E(x) = strain + bending + gravity + collision + |x - x_hat|^2 + NEARNESS |x - s_t|^2,
    |y|^2 = 1/(2 dt^2) y^T M y                                                                      [J]

with x the network's frame. Both parts have their minimum at s_t. That is not the same as to fit vertices: a
network that knows only how the body moved cannot tell every wrinkle, and the mean of many wrinkles is
stretched cloth, for which the strain charges. Nor is it the same without the distance: where x_hat cannot be
told either, least strain is where the cloth swings less, for its paths are curved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from snug.baselines.supervised import matched_targets
from snug.training_set import Batch, TrainingSet

NEARNESS = 2.0


class SimulatedPast:
    """The simulated frames (F', V, 3) [m] of a training set's first motions, relative to the pelvis.

    Of frames that were not simulated nothing is asked. Raises TargetError for a motion without a fitting
    trajectory.
    """

    def __init__(
        self, data: TrainingSet, motions: Sequence[Any], trajectories: Mapping[str, Any] | None
    ) -> None:
        dressed = data.dressed
        targets = matched_targets(motions, trajectories, dressed.vertices)
        pelvis = [dressed.pelvis(motion) for motion in motions]
        rows = [torch.as_tensor(x - p[:, None]).float() for x, p in zip(targets, pelvis)]
        self.frames = torch.cat(rows).to(data.device)
        third = [torch.arange(len(x)) >= 2 for x in rows]  # with two before it in its motion
        self.third = torch.cat(third).to(data.device)
        masses = torch.as_tensor(dressed.cloth.masses, dtype=torch.float32, device=data.device)
        self.stiffness = masses[:, None] / data.dt**2  # (V, 1) [N/m]

    def terms(self, x: Tensor, batch: Batch) -> dict[str, Tensor]:
        """Joules (N, T) of vertices x (N, T, V, 3) [m] relative to the pelvis: inertia and the distance."""
        rows = torch.as_tensor(batch.frames, device=x.device)
        known = rows < len(self.frames)
        rows = rows.clamp(max=len(self.frames) - 1)
        now, before, earlier = (self.frames[(rows - ago).clamp(min=0)] for ago in range(3))
        x_hat = 2 * before - earlier + batch.ahead[..., None, :]
        inertia, distance = (0.5 * (self.stiffness * (x - y).square()).sum((-1, -2)) for y in (x_hat, now))
        return {"inertia": inertia * (known & self.third[rows]), "distance": NEARNESS * distance * known}
