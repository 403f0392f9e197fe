"""TailorNet (Patel et al. 2020): the folds of a garment in two bands, each by its own perceptron.

    offsets(theta, beta) = low(theta, beta) + high(theta)

Both have three layers of 1024 with ReLU, dropout 0.2 after the first; they learn by L1 in the unposed
space (snug.training.simulated_data.BandTargets): low the diffusion-smoothed offsets of the simulation,
high the rest. With its authors the high band is a mean of some twenty networks, each of a pivot, that is of a
body shape and a style of garment. Our simulated motions show the mean body in one style, hence one pivot.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from snug.body.parametric_body import SHAPES
from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork

WIDTH, DROPOUT = 1024, 0.2


class _Perceptron(nn.Module):
    """A map from numbers (N, T, D) to (N, T, 3V); a mask (N, 1, 1024) scales the first layer in training."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(inputs, WIDTH), nn.Linear(WIDTH, WIDTH)
        self.last = nn.Linear(WIDTH, outputs)

    def forward(self, numbers: Tensor, mask: Tensor | None) -> Tensor:
        hidden = torch.relu(self.first(numbers))
        hidden = hidden if mask is None else hidden * mask
        return self.last(torch.relu(self.second(hidden)))

    def lay_out(self, plan: FramePlan, x: slice) -> tuple[nn.Linear, slice]:
        """Return the last layer and the place of its inputs, computed from numbers at x."""
        for layer in (self.first, self.second):
            x = plan.add_linear(layer, x, nn.ReLU)
        return self.last, x


class FrequencyMixture(GarmentNetwork):
    """A low and a high band of offsets; the last ten features are the shape. No state at run time."""

    feature_set = "pose_shape"
    sequential = False

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__(inputs, vertices)
        self.low = _Perceptron(inputs, 3 * vertices)
        self.high = _Perceptron(inputs - SHAPES, 3 * vertices)

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor:
        """Draw dropout masks (2, N, 1, 1024) from the training's own generator."""
        mask = torch.rand((2, batch, 1, WIDTH), generator=generator, device=generator.device) >= DROPOUT
        return mask.to(self.input_mean) / (1 - DROPOUT)

    def bands(self, features: Tensor, masks: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return the low and the high band of the offsets, each (N, T, V, 3) [m]."""
        normalised = self.normalise(features)
        drop = [None, None] if masks is None else list(masks)
        flat = self.low(normalised, drop[0]), self.high(normalised[..., :-SHAPES], drop[1])
        low, high = (band.unflatten(-1, (self.vertices, 3)) for band in flat)
        return self.output_scale * low, self.output_scale * high

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        low, high = self.bands(features, state)
        return low + high, None

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layers whose sum the offsets are."""
        return self.low.last, self.high.last

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        pose = slice(x.start, x.stop - SHAPES)
        plan.add_offsets(self.low.lay_out(plan, x), self.high.lay_out(plan, pose))
