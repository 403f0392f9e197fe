"""A regressor in two stages: recurrent units that predict how the garment swings, and a decoder to its shape.

The dynamics are a few numbers (coordinates along the widest principal components of a simulation, each in
units of its spread, see snug.pca_dynamics). Which shape the cloth takes with them is left to the decoder, a
Regressor that sees them beside the motion:

    c = dynamics(motion so far)          offsets = R(motion, c)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from snug.fast_network import FastLinear, run_gru, run_linear
from snug.regressor import HIDDEN, Regressor

if TYPE_CHECKING:
    from snug.frame_plan import FramePlan

DYNAMICS_LAYERS = 2


class TwoStageRegressor(Regressor):
    """As a Regressor; the state holds the layers of the dynamics and, after them, the decoder's.

    components: coordinates of the dynamics, K. The features (N, T, D) may come with the coordinates,
    (N, T, D + K), where those are known for every frame: training does so, in windows too short to show
    how a garment swings. The energies then train the decoder alone.
    """

    def __init__(self, inputs: int, vertices: int, *, components: int, **options: Any) -> None:
        super().__init__(inputs, vertices, further=components, **options)
        self.dynamics = nn.GRU(inputs, HIDDEN, DYNAMICS_LAYERS, batch_first=True)
        self.coordinates = nn.Linear(HIDDEN, components)

    def coordinates_of(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Coordinates (N, T, K) [spreads] of features (N, T, D), and the state of the dynamics."""
        normalised = (features - self.input_mean) / self.input_std
        if self.closed_form and torch.is_grad_enabled():
            hidden, state = run_gru(self.dynamics, normalised, state)
            return FastLinear.apply(hidden, self.coordinates.weight, self.coordinates.bias), state
        hidden, state = self.dynamics(normalised, state)
        return run_linear(self.coordinates, hidden), state

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        inputs = len(self.input_mean)
        features, known = features[..., :inputs], features[..., inputs:]
        moving, decoding = (
            (None, None) if state is None else (state[:DYNAMICS_LAYERS], state[DYNAMICS_LAYERS:])
        )
        if known.shape[-1]:
            moving = features.new_zeros(DYNAMICS_LAYERS, len(features), HIDDEN)
        else:
            with torch.no_grad():
                known, moving = self.coordinates_of(features, moving)
        normalised = (features - self.input_mean) / self.input_std
        offsets, decoding = self.answer(torch.cat([normalised, known], -1), decoding)
        return offsets, torch.cat([moving, decoding])

    def lay_out(self, plan: FramePlan) -> None:
        """`forward` for one frame."""
        x = plan.normalised(self, further=self.coordinates.out_features)
        known = x.start + len(self.input_mean)
        moving = plan.gru(self.dynamics, slice(x.start, known))
        plan.linear(self.coordinates, moving, target=slice(known, x.stop))
        plan.offsets(self, (self.offsets, plan.gru(self.gru, x)))

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor:
        """(layers, batch, hidden): the decoder's from N(0, sigma), that of the dynamics zero."""
        noise = super().random_state(batch, sigma, generator)
        return torch.cat([noise.new_zeros(DYNAMICS_LAYERS, batch, HIDDEN), noise])
