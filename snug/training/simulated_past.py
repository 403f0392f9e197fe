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

The energies teach soft motions slowly, and a swing is the softest. So before them, in a pretraining, the
network is fitted to the simulated offsets along their widest principal components. That needs no garment: an
update costs a fifth of one by the energies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from snug.body.skinning import unskin
from snug.networks.motion_perceptron import MotionPerceptron
from snug.training.training_set import Batch, TrainingSet
from snug.training.vertex_targets import Targets, all_relative, matched_targets

if TYPE_CHECKING:
    from snug.motion.motion import Motion

NEARNESS = 1.0
COMPONENTS = 96  # of the pretraining: they hold 98.7 % of the variance
RATE, FRAMES = 2e-3, 128  # of Adam in the pretraining, and of one update


class SimulatedPast:
    """The simulated frames (F', V, 3) [m] of a training set's first motions, relative to the pelvis.

    Of frames that were not simulated nothing is asked. Raises TargetError for a motion without a fitting
    trajectory.
    """

    def __init__(
        self, data: TrainingSet, motions: Sequence[Motion], trajectories: Mapping[str, Targets] | None
    ) -> None:
        self.data, dressed = data, data.dressed
        targets = matched_targets(motions, trajectories, dressed.vertices)
        self.frames = all_relative(dressed, motions, targets).to(data.device)
        third = [torch.arange(motion.frames) >= 2 for motion in motions]  # with two before it in its motion
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

    def pretrain(self, network: MotionPerceptron, weights: Tensor, *, steps: int, seed: int) -> None:
        """Fit the network to the simulated offsets by so many updates. weights (V, J): of the skinning."""
        data, count = self.data, len(self.frames)
        offsets = (unskin(self.frames, weights, data.transforms[:count]) - data.rest).flatten(1)
        offsets /= network.output_scale
        mean, most = offsets.mean(0), min(COMPONENTS, *offsets.shape)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            directions = torch.pca_lowrank(offsets, most)[2]  # (3V, K)
            answers = nn.Linear(network.widths[-1], most).to(offsets.device)
        wanted = (offsets - mean) @ directions
        spread = wanted.std(0, correction=0)
        spread.clamp_(min=1e-4 * float(spread.max()))
        wanted, share = wanted / spread, spread / spread.norm()
        features = (data.features[:count] - network.input_mean) / network.input_std
        learned = [*network.activations.parameters(), *answers.parameters()]
        optimiser = torch.optim.AdamW(learned, lr=RATE, weight_decay=data.recipe.weight_decay, fused=True)
        rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, max(steps, 1))
        random = np.random.default_rng(seed)
        for _ in range(steps):
            rows = torch.as_tensor(random.integers(count, size=FRAMES), device=offsets.device)
            away = (answers(network.activations(features[rows])) - wanted[rows]) * share
            optimiser.zero_grad(set_to_none=True)
            away.square().sum(-1).mean().backward()
            optimiser.step()
            rate.step()
        with torch.no_grad():
            network.offsets.weight.copy_(directions @ (spread[:, None] * answers.weight))
            network.offsets.bias.copy_(mean + directions @ (spread * answers.bias))
        optimiser.zero_grad(set_to_none=True)
