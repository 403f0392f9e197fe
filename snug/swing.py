"""What a simulation teaches beside the energies: how the garment swings, and nothing finer.

The energies alone teach a network to dress, not to swing: a dresser without memory is consistent with its own
past, and inertia weighs little in the sum. A simulation knows the swing, but its wrinkles depend on the past
too closely to be learned; a network that is fitted to them averages them, and an averaged wrinkle is
stretched cloth. So the simulated offsets (unposed, see DressedBody) are split by their principal components:

    offsets(t) = mean + sum_i c_i(t) b_i,     b_i orthonormal, the widest first

The few widest are the swing. The last layer starts with them, one hidden unit for each, and before any energy
is asked for the recurrent units rehearse the coordinates on whole motions: that needs no garment, so a step
costs little. Then the loss holds the coordinates to the simulation's as inertia would hold a whole garment,

    swing(t) = s m / (2 dt^2) sum_{i <= K} (<offsets(t) - mean, b_i> - c_i(t))^2      [J]

with m the mean mass of a vertex and s the recipe's `swing`. What is finer is left to the energies, whose
inertia then takes the network's own previous frames as given (the recipe's `detached`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from snug.baselines.supervised import TargetError, matched_targets
from snug.recipe import Recipe
from snug.regressor import Regressor
from snug.skinning import unposed
from snug.training_set import Batch, TrainingSet

REHEARSAL_RATE = 2e-3  # of Adam
TOGETHER = 6  # motions of a rehearsal's step
REACH = 3.0  # standard deviations of a component at which its hidden unit is at its end
BLIND = 12  # frames after a start within a motion in which the state cannot know the swing


class SwingTeacher:
    """Coordinates of the simulated swing in every training frame.

    Raises TargetError for a motion without a fitting trajectory, and for fewer frames than components.
    """

    def __init__(
        self,
        data: TrainingSet,
        motions: Sequence[Any],
        trajectories: Mapping[str, np.ndarray] | None,
        weights: Tensor,
        recipe: Recipe,
    ) -> None:
        dressed = data.dressed
        vertices = matched_targets(motions, trajectories, dressed.vertices)
        pelvis = [dressed.pelvis(motion) for motion in motions]
        posed = torch.cat([torch.as_tensor(x - p[:, None]).float() for x, p in zip(vertices, pelvis)])
        offsets = unposed(posed.to(data.device), weights, data.transforms) - data.rest
        flat = offsets.flatten(1)
        if len(flat) <= recipe.swing_components:
            raise TargetError(
                f"{len(flat)} simulated frames cannot give {recipe.swing_components} components of a swing: "
                "simulate longer motions, or ask for fewer"
            )
        self.mean = flat.mean(0)
        _, widths, directions = torch.linalg.svd(flat - self.mean, full_matrices=False)
        self.directions = directions[: recipe.swing_components]  # (K, 3V)
        self.spread = widths[: recipe.swing_components] / len(flat) ** 0.5  # (K,) [m]
        self.coordinates = (flat - self.mean) @ self.directions.T  # (F, K) [m]
        self.features = data.features
        self.bounds = [(int(a), int(b)) for a, b in pairwise(data.first)]
        self.first = torch.as_tensor(data.first[:-1], device=data.device)
        self.stiffness = recipe.swing * float(dressed.cloth.masses.mean()) / data.dt**2

    def start(self, network: Regressor, *, steps: int, sigma: float, seed: int) -> None:
        """Give the last layer the mean and the components, and let the recurrent units rehearse.

        steps: updates of the rehearsal; sigma: of the noise that states start from.
        """
        self._begin_with_components(network)
        optimiser = torch.optim.Adam(network.gru.parameters(), lr=REHEARSAL_RATE)
        random, noise = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
        reach = REACH * self.spread
        # A component that hardly moves is not worth a hidden unit's whole range.
        weights = (self.spread / self.spread[0]).clamp(min=0.02)
        for step in range(steps):
            for group in optimiser.param_groups:
                group["lr"] = REHEARSAL_RATE * (0.2 if step >= 0.7 * steps else 1.0)
            chosen = random.choice(len(self.bounds), min(TOGETHER, len(self.bounds)), replace=False)
            parts = [slice(*self.bounds[number]) for number in chosen]
            features = pad_sequence([self.features[part] for part in parts], batch_first=True)
            wanted = pad_sequence([self.coordinates[part] / reach for part in parts], batch_first=True)
            there = pad_sequence(
                [torch.ones_like(self.features[part, 0]) for part in parts], batch_first=True
            )
            state = network.random_state(len(parts), sigma, noise)
            hidden, _ = network.gru((features - network.input_mean) / network.input_std, state)
            apart = ((hidden[..., : len(reach)] - wanted) * weights).square().sum(-1) * there
            optimiser.zero_grad(set_to_none=True)
            (apart.sum() / there.sum()).backward()
            torch.nn.utils.clip_grad_norm_(network.gru.parameters(), 1.0)
            optimiser.step()

    def _begin_with_components(self, network: Regressor) -> None:
        count = len(self.directions)
        with torch.no_grad():
            network.offsets.weight.zero_()
            network.offsets.weight[:, :count] = (
                (self.directions.T * self.spread) * REACH / network.output_scale
            )
            network.offsets.bias.copy_(self.mean / network.output_scale)

    def swing(self, offsets: Tensor, batch: Batch) -> Tensor:
        """Joules (N, T) of offsets (N, T, V, 3): see above. Zero in the BLIND frames of a window."""
        rows = torch.as_tensor(batch.frames, device=offsets.device)
        apart = (offsets.flatten(2) - self.mean) @ self.directions.T - self.coordinates[rows]
        place = torch.arange(rows.shape[1], device=rows.device)
        knows = (place >= BLIND) | torch.isin(rows[:, :1], self.first)
        return 0.5 * self.stiffness * apart.square().sum(-1) * knows
