"""Inertia and distance with respect to a simulation, for a network that learns from the energies.

Inertia measures the distance from where the cloth would be if nothing but its own velocity moved it,
x_hat = 2 x_{t-1} - x_{t-2}. A network that predicts the frames t-1 and t-2 itself makes them agree with a
still present: to hang still costs no energy. So the two frames are those of a simulation, s, and the loss of
frame t is the function that the simulator minimised in that frame, and a distance that weighs NEARNESS times
as much as inertia,

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

import numpy as np
import torch
from torch import Tensor, nn

from snug.body.skinning import unskin
from snug.motion.motion import Motion
from snug.networks.initialisation import seeded
from snug.networks.motion_perceptron import MotionPerceptron
from snug.training.losses.vertex_targets import Targets, load_relative, match_targets
from snug.training.training_set import Batch, TrainingSet

NEARNESS = 1.0  # weight of the distance, relative to that of inertia
COMPONENTS = 96  # of the pretraining: they hold 98.7 % of the variance
PRETRAINING_RATE, PRETRAINING_FRAMES = 2e-3, 128  # rate of Adam, frames of one update


class SimulatedPast:
    """The simulated frames (F', V, 3) [m] of a training set's first motions, relative to the pelvis.

    Frames that were not simulated, those of augmented clips, have neither term. Raises TargetError for a
    motion without a fitting trajectory.
    """

    def __init__(
        self, data: TrainingSet, motions: Sequence[Motion], trajectories: Mapping[str, Targets] | None
    ) -> None:
        self.data, dressed = data, data.dressed
        targets = match_targets(motions, trajectories, dressed.vertices)
        self.frames = load_relative(dressed, motions, targets).to(data.device)
        third = [torch.arange(motion.frames) >= 2 for motion in motions]  # with two before it in its motion
        self.third = torch.cat(third).to(data.device)
        masses = torch.as_tensor(dressed.cloth.masses, dtype=torch.float32, device=data.device)
        self.stiffness = masses[:, None] / data.dt**2  # (V, 1) [N/m]

    def terms(self, x: Tensor, batch: Batch) -> dict[str, Tensor]:
        """Return inertia and distance (N, T) [J] of vertices x (N, T, V, 3) [m] relative to the pelvis."""
        rows = torch.as_tensor(batch.frames, device=x.device)
        known = rows < len(self.frames)
        rows = rows.clamp(max=len(self.frames) - 1)
        now, before, earlier = (self.frames[(rows - ago).clamp(min=0)] for ago in range(3))
        x_hat = 2 * before - earlier + batch.ahead[..., None, :]
        inertia, distance = (0.5 * (self.stiffness * (x - y).square()).sum((-1, -2)) for y in (x_hat, now))
        return {"inertia": inertia * (known & self.third[rows]), "distance": NEARNESS * distance * known}

    def pretrain(self, network: MotionPerceptron, weights: Tensor, *, steps: int, seed: int) -> None:
        """Fit the network to the simulated offsets by `steps` updates. weights (V, J): of the skinning."""
        data, count = self.data, len(self.frames)
        offsets = (unskin(self.frames, weights, data.transforms[:count]) - data.rest).flatten(1)
        offsets /= network.output_scale
        mean, components = offsets.mean(0), min(COMPONENTS, *offsets.shape)
        with seeded(seed):
            directions = torch.pca_lowrank(offsets, components)[2]  # (3V, K)
            head = nn.Linear(network.widths[-1], components).to(offsets.device)
        coefficients = (offsets - mean) @ directions
        spread = coefficients.std(0, correction=0)
        spread.clamp_(min=1e-4 * float(spread.max()))
        coefficients, share = coefficients / spread, spread / spread.norm()
        features = (data.features[:count] - network.input_mean) / network.input_std
        parameters = [*network.activations.parameters(), *head.parameters()]
        optimiser = torch.optim.AdamW(
            parameters, lr=PRETRAINING_RATE, weight_decay=data.recipe.weight_decay, fused=True
        )
        rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, max(steps, 1))
        random = np.random.default_rng(seed)
        for _ in range(steps):
            rows = torch.as_tensor(random.integers(count, size=PRETRAINING_FRAMES), device=offsets.device)
            error = (head(network.activations(features[rows])) - coefficients[rows]) * share
            optimiser.zero_grad(set_to_none=True)
            error.square().sum(-1).mean().backward()
            optimiser.step()
            rate.step()
        with torch.no_grad():
            network.offsets.weight.copy_(directions @ (spread[:, None] * head.weight))
            network.offsets.bias.copy_(mean + directions @ (spread * head.bias))
        optimiser.zero_grad(set_to_none=True)
