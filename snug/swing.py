"""What a simulation teaches beside the energies: how the garment swings, and nothing finer.

The energies alone teach a network to dress, not to swing: a dresser without memory is consistent with its own
past, and inertia weighs little in the sum. A simulation knows the swing, but its wrinkles depend on the past
too closely to be learned; a network that is fitted to them averages them, and an averaged wrinkle is
stretched cloth. So the simulated offsets (unposed, see DressedBody) are split by their principal components:

    offsets(t) = mean + sum_i spread_i c_i(t) b_i,     b_i orthonormal, the widest first

The few widest are the swing. Before any energy is asked for, recurrent units of their own rehearse the c_i on
whole motions: that needs no garment, so a step costs little. Then they are left as they are, every training
frame gets the c_i that they tell, and the dresser learns from the energies which shape goes with them, held
to them as inertia would hold a whole garment,

    swing(t) = s m / (2 dt^2) sum_i (<offsets(t) - mean, b_i> - spread_i c_i(t))^2      [J]

with m the mean mass of a vertex and s the recipe's `swing`. The dresser starts at no offset and not at the
components' sum: that is stretched cloth, and it takes longer to mend than to learn anew. What the components
do not hold is left to the energies, whose inertia takes the network's own previous frames as given (the
recipe's `detached`).
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
from snug.regressor import HIDDEN
from snug.skinning import unposed
from snug.swinging_regressor import SWING_LAYERS, SwingingRegressor
from snug.training_set import Batch, TrainingSet

REHEARSAL_RATE = 2e-3  # of Adam
TOGETHER = 6  # motions of a rehearsal's step
LEAST_WEIGHT = 0.1  # of a narrow component, in the rehearsal: its coordinate is the dresser's input too


class SwingTeacher:
    """Coordinates of the simulated swing in every training frame.

    motions: those that were simulated. Frames of the set after theirs take no part in the rehearsal, and are
    then told and held to coordinates like all others.
    Raises TargetError for a motion without a fitting trajectory, and for fewer frames than coordinates.
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
        offsets = unposed(posed.to(data.device), weights, data.transforms[: len(posed)]) - data.rest
        flat = offsets.flatten(1)
        if len(flat) <= recipe.swing_components:
            raise TargetError(
                f"{len(flat)} simulated frames cannot give {recipe.swing_components} components of a swing: "
                "simulate longer motions, or ask for fewer"
            )
        self.mean = flat.mean(0)
        _, widths, directions = torch.linalg.svd(flat - self.mean, full_matrices=False)
        # In rows, as a checkpoint keeps them: a product of another layout rounds otherwise.
        self.directions = directions[: recipe.swing_components].clone(
            memory_format=torch.contiguous_format
        )  # (K, 3V)
        # Where a garment swings in fewer ways than there are components, the rest is round-off.
        widths = widths[: recipe.swing_components].clamp(min=1e-4 * float(widths[0]))
        self.spread = widths / len(flat) ** 0.5  # (K,) [m]
        self.coordinates = (flat - self.mean) @ self.directions.T / self.spread  # (F, K)
        self.data = data
        self.bounds = [(int(a), int(b)) for a, b in pairwise(data.first)]
        self.simulated = len(motions)
        self.stiffness = recipe.swing * float(dressed.cloth.masses.mean()) / data.dt**2

    def start(self, network: SwingingRegressor, *, steps: int, sigma: float, seed: int) -> None:
        """Rehearse for that many updates, and give every training frame the coordinates that came of it.

        The network's swing is not trained any more after it. sigma: of the noise that its states start from.
        """
        learned = [*network.swing.parameters(), *network.coordinates.parameters()]
        optimiser = torch.optim.Adam(learned, lr=REHEARSAL_RATE)
        random, noise = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
        for step in range(steps):
            for group in optimiser.param_groups:
                group["lr"] = REHEARSAL_RATE * min(1.0, 2.04 - 2 * step / steps)
            chosen = random.choice(self.simulated, min(TOGETHER, self.simulated), replace=False)
            optimiser.zero_grad(set_to_none=True)
            self._apart(network, chosen, sigma, noise).backward()
            torch.nn.utils.clip_grad_norm_(learned, 1.0)
            optimiser.step()
        for parameter in learned:
            parameter.requires_grad_(False)
            parameter.grad = None
        features = self.data.features
        with torch.no_grad():
            told = [network.coordinates_of(features[None, a:b])[0][0] for a, b in self.bounds]
        self.data.features = torch.cat([features, torch.cat(told)], -1)

    def _apart(
        self, network: SwingingRegressor, chosen: np.ndarray, sigma: float, noise: torch.Generator
    ) -> Tensor:
        """Mean squared error of the coordinates over those motions, the widest weighing most."""
        parts = [slice(*self.bounds[number]) for number in chosen]
        features = pad_sequence([self.data.features[part] for part in parts], batch_first=True)
        wanted = pad_sequence([self.coordinates[part] for part in parts], batch_first=True)
        there = pad_sequence([torch.ones_like(self.coordinates[part, 0]) for part in parts], batch_first=True)
        state = sigma * torch.randn(SWING_LAYERS, len(parts), HIDDEN, generator=noise)
        told, _ = network.coordinates_of(features, state.to(features.device))
        weights = (self.spread / self.spread[0]).clamp(min=LEAST_WEIGHT)
        apart = ((told - wanted) * weights).square().sum(-1) * there
        return apart.sum() / there.sum()

    def swing(self, offsets: Tensor, batch: Batch) -> Tensor:
        """Joules (N, T) of offsets (N, T, V, 3) in a batch whose features hold the coordinates: see above."""
        wanted = batch.features[..., -len(self.spread) :] * self.spread
        apart = (offsets.flatten(2) - self.mean) @ self.directions.T - wanted
        return 0.5 * self.stiffness * apart.square().sum(-1)

    def state(self) -> dict[str, Tensor]:
        """What a resumed training goes on with; made anew, another thread count might round it otherwise."""
        told = self.data.features[:, -len(self.spread) :]
        return {"told": told, "mean": self.mean, "directions": self.directions, "spread": self.spread}

    def resume(self, tensors: Mapping[str, Tensor]) -> None:
        """The inverse of `state`."""
        device = self.data.device
        self.data.features[:, -len(self.spread) :] = tensors["told"].to(device)
        self.mean, self.directions, self.spread = (
            tensors[name].to(device) for name in ("mean", "directions", "spread")
        )
