"""What a simulation teaches beside the energies: how the garment swings, and nothing finer.

The energies alone teach a network to dress, not to swing. A decoder without memory is consistent with its own
past, and inertia weighs little in the sum. A simulation knows the swing, but its wrinkles depend on the past
too closely to be learned: a network that is fitted to them averages them, and an averaged wrinkle is
stretched cloth. So the simulated offsets (unposed, see DressedBody) are split by principal components (PCA):

    offsets(t) = mean + sum_i spread_i c_i(t) b_i,     b_i orthonormal, the widest first

The few widest are the dynamics. In a pretraining, before any energy is asked for, recurrent units of their
own learn the c_i of whole motions: that needs no garment, so a step costs little. Then they are frozen, and
every training frame gets the c_i that they predict. The decoder learns from the energies which shape goes
with them, held to them as inertia would hold a whole garment,

    E(t) = s m / (2 dt^2) sum_i (<offsets(t) - mean, b_i> - spread_i c_i(t))^2      [J]

with m the mean mass of a vertex and s the recipe's `pca_dynamics`. The decoder starts at no offset and not at
the components' sum: that is stretched cloth, and it takes longer to mend than to learn anew. What the
components do not hold is left to the energies, whose inertia takes the network's own previous frames as given
(the recipe's `detached`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from snug.baselines.supervised import TargetError, Targets, all_relative, matched_targets
from snug.recipe import Recipe
from snug.regressor import HIDDEN
from snug.skinning import unposed
from snug.training_set import Batch, TrainingSet
from snug.two_stage_regressor import DYNAMICS_LAYERS, TwoStageRegressor

PRETRAINING_RATE = 2e-3  # of Adam
MOTIONS_PER_STEP = 6  # of the pretraining
LEAST_WEIGHT = 0.1  # of a narrow component, in the pretraining: its coordinate is the decoder's input too


class DynamicsSupervision:
    """Coordinates of the simulated dynamics in every training frame.

    motions: those that were simulated. Frames of the set after theirs take no part in the pretraining.
    They are then given coordinates and held to them like all others.
    Raises TargetError for a motion without a fitting trajectory, and for fewer frames than coordinates.
    """

    def __init__(
        self,
        data: TrainingSet,
        motions: Sequence[Any],
        trajectories: Mapping[str, Targets] | None,
        weights: Tensor,
        recipe: Recipe,
    ) -> None:
        dressed = data.dressed
        posed = all_relative(dressed, motions, matched_targets(motions, trajectories, dressed.vertices))
        offsets = unposed(posed.to(data.device), weights, data.transforms[: len(posed)]) - data.rest
        flat = offsets.flatten(1)
        if len(flat) <= recipe.pca_components:
            raise TargetError(
                f"{len(flat)} simulated frames cannot give {recipe.pca_components} components: "
                "simulate longer motions, or ask for fewer"
            )
        self.mean = flat.mean(0)
        _, widths, directions = torch.linalg.svd(flat - self.mean, full_matrices=False)
        # In rows, as a checkpoint keeps them: a product of another layout rounds otherwise.
        self.directions = directions[: recipe.pca_components].clone(
            memory_format=torch.contiguous_format
        )  # (K, 3V)
        # Where a garment swings in fewer ways than there are components, the rest is round-off.
        widths = widths[: recipe.pca_components].clamp(min=1e-4 * float(widths[0]))
        self.spread = widths / len(flat) ** 0.5  # (K,) [m]
        self.coordinates = (flat - self.mean) @ self.directions.T / self.spread  # (F, K)
        self.data = data
        self.bounds = [(int(a), int(b)) for a, b in pairwise(data.first)]
        self.simulated = len(motions)
        self.stiffness = recipe.pca_dynamics * float(dressed.cloth.masses.mean()) / data.dt**2

    def pretrain(self, network: TwoStageRegressor, *, steps: int, sigma: float, seed: int) -> None:
        """Pretrain for that many updates, and give every training frame the coordinates that came of it.

        The network's first stage is not trained any more after it. sigma: of the noise that its states start
        from.
        """
        learned = [*network.dynamics.parameters(), *network.coordinates.parameters()]
        optimiser = torch.optim.Adam(learned, lr=PRETRAINING_RATE)
        random, noise = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
        for step in range(steps):
            for group in optimiser.param_groups:
                group["lr"] = PRETRAINING_RATE * min(1.0, 2.04 - 2 * step / steps)
            chosen = random.choice(self.simulated, min(MOTIONS_PER_STEP, self.simulated), replace=False)
            optimiser.zero_grad(set_to_none=True)
            self._apart(network, chosen, sigma, noise).backward()
            torch.nn.utils.clip_grad_norm_(learned, 1.0)
            optimiser.step()
        for parameter in learned:
            parameter.requires_grad_(False)
            parameter.grad = None
        features = self.data.features
        with torch.no_grad():
            predicted = [network.coordinates_of(features[None, a:b])[0][0] for a, b in self.bounds]
        self.data.features = torch.cat([features, torch.cat(predicted)], -1)

    def _apart(
        self, network: TwoStageRegressor, chosen: np.ndarray, sigma: float, noise: torch.Generator
    ) -> Tensor:
        """Mean squared error of the coordinates over those motions, the widest weighing most."""
        parts = [slice(*self.bounds[number]) for number in chosen]
        features = pad_sequence([self.data.features[part] for part in parts], batch_first=True)
        wanted = pad_sequence([self.coordinates[part] for part in parts], batch_first=True)
        there = pad_sequence([torch.ones_like(self.coordinates[part, 0]) for part in parts], batch_first=True)
        state = sigma * torch.randn(DYNAMICS_LAYERS, len(parts), HIDDEN, generator=noise)
        predicted, _ = network.coordinates_of(features, state.to(features.device))
        weights = (self.spread / self.spread[0]).clamp(min=LEAST_WEIGHT)
        apart = ((predicted - wanted) * weights).square().sum(-1) * there
        return apart.sum() / there.sum()

    def energy(self, offsets: Tensor, batch: Batch) -> Tensor:
        """Joules (N, T) of offsets (N, T, V, 3) in a batch whose features hold the coordinates: see above."""
        wanted = batch.features[..., -len(self.spread) :] * self.spread
        apart = (offsets.flatten(2) - self.mean) @ self.directions.T - wanted
        return 0.5 * self.stiffness * apart.square().sum(-1)

    def state(self) -> dict[str, Tensor]:
        """What a resumed training goes on with; made anew, another thread count might round it otherwise."""
        predicted = self.data.features[:, -len(self.spread) :]
        return {
            "predicted": predicted,
            "mean": self.mean,
            "directions": self.directions,
            "spread": self.spread,
        }

    def resume(self, tensors: Mapping[str, Tensor]) -> None:
        """The inverse of `state`."""
        device = self.data.device
        self.data.features[:, -len(self.spread) :] = tensors["predicted"].to(device)
        self.mean, self.directions, self.spread = (
            tensors[name].to(device) for name in ("mean", "directions", "spread")
        )
