"""A regressor in two parts: recurrent units that tell how the garment swings, and the dresser who is told.

The swing is a few numbers (coordinates along the widest principal components of a simulation, each in units
of its spread, see snug.swing); which shape the cloth takes with them is left to the dresser, a Regressor that
sees them beside the motion:

    c = swing(motion so far)          offsets = R(motion, c)
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from snug.fast_network import FastLinear, run_gru, run_linear
from snug.regressor import HIDDEN, Regressor

SWING_LAYERS = 2


class SwingingRegressor(Regressor):
    """As a Regressor; the state holds the swing's layers and, after them, the dresser's.

    components: coordinates of the swing, K. The features (N, T, D) may come with the coordinates,
    (N, T, D + K), where those are known for every frame: training does so, in windows too short to tell how
    a garment swings. The energies then train the dresser alone.
    """

    def __init__(self, inputs: int, vertices: int, *, components: int, **options: Any) -> None:
        super().__init__(inputs, vertices, further=components, **options)
        self.swing = nn.GRU(inputs, HIDDEN, SWING_LAYERS, batch_first=True)
        self.coordinates = nn.Linear(HIDDEN, components)

    def coordinates_of(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Coordinates (N, T, K) [spreads] of features (N, T, D), and the swing's state."""
        normalised = (features - self.input_mean) / self.input_std
        if self.closed_form and torch.is_grad_enabled():
            hidden, state = run_gru(self.swing, normalised, state)
            return FastLinear.apply(hidden, self.coordinates.weight, self.coordinates.bias), state
        hidden, state = self.swing(normalised, state)
        return run_linear(self.coordinates, hidden), state

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        inputs = len(self.input_mean)
        features, known = features[..., :inputs], features[..., inputs:]
        swinging, dressing = (None, None) if state is None else (state[:SWING_LAYERS], state[SWING_LAYERS:])
        if known.shape[-1]:
            swinging = features.new_zeros(SWING_LAYERS, len(features), HIDDEN)
        else:
            with torch.no_grad():
                known, swinging = self.coordinates_of(features, swinging)
        normalised = (features - self.input_mean) / self.input_std
        offsets, dressing = self.answer(torch.cat([normalised, known], -1), dressing)
        return offsets, torch.cat([swinging, dressing])

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor:
        """(layers, batch, hidden): the dresser's from N(0, sigma), the swing's zero."""
        noise = super().random_state(batch, sigma, generator)
        return torch.cat([noise.new_zeros(SWING_LAYERS, batch, HIDDEN), noise])
