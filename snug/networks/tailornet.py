"""TailorNet (Patel et al. 2020): the folds of a garment in two bands, each by its own perceptron.

    offsets(theta, beta) = low(theta, beta) + sum_k w_k(beta) high_k(theta)
    w_k(beta) = exp(-|beta - beta_k|^2 / (2 sigma^2)), normalised to sum one

low and every high_k have three layers of 1024 with ReLU, dropout 0.2 after the first; they learn by L1
in the unposed space (snug.training.losses.vertex_targets.BandTargets): low the diffusion-smoothed offsets of
the simulation, high the rest. Each high_k belongs to one pivot, a body shape beta_k. With its authors a pivot
is a shape and a style of garment, and distances are those of the garments in one pose; we have no style
input, so it is dropped, and distances are those of the shape numbers. Our simulated motions show the mean
body alone: one pivot, of weight one, is all that they can teach, and memory and run time are those of one
pivot instead of twenty. A static method: it sees one pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import torch
from torch import Tensor, nn

from snug.body.parametric_body import SHAPES
from snug.networks.garment_network import GarmentNetwork

if TYPE_CHECKING:
    from snug.networks.frame_layout import FramePlan

WIDTH, DROPOUT = 1024, 0.2
SIGMA = 1.0  # of the kernel, in units of the shape numbers


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
    """A low and a high band of offsets; the last ten features are the shape. No state at run time.

    Args:
        inputs: number of features.
        vertices: number of the garment's vertices.
        output_scale: factor on the offsets.
        pivots: body shapes (K, 10); by default the mean body alone.
    """

    feature_set = "pose_shape"
    sequential = False
    pivots: Tensor

    def __init__(
        self,
        inputs: int,
        vertices: int,
        *,
        output_scale: float = 1.0,
        pivots: Sequence[Sequence[float]] = ((0.0,) * SHAPES,),
    ) -> None:
        super().__init__(inputs, vertices, output_scale=output_scale)
        self.register_buffer("pivots", torch.as_tensor(pivots, dtype=torch.float32))
        self.low = _Perceptron(inputs, 3 * vertices)
        self.high = nn.ModuleList(_Perceptron(inputs - SHAPES, 3 * vertices) for _ in pivots)

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor:
        """Draw dropout masks (1 + K, N, 1, 1024) from the training's own generator."""
        shape = (1 + len(self.high), batch, 1, WIDTH)
        kept = torch.rand(shape, generator=generator, device=generator.device) >= DROPOUT
        return kept.to(self.input_mean) / (1 - DROPOUT)

    def weights(self, betas: Tensor) -> Tensor:
        """Return the weights (..., K) of the pivots for shapes (..., 10): at least zero, of sum one."""
        squared = (betas[..., None, :] - self.pivots).square().sum(-1)
        return torch.softmax(-squared / (2 * SIGMA**2), dim=-1)

    def bands(self, features: Tensor, masks: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return the low and the high band of the offsets, each (N, T, V, 3) [m]."""
        normalised = self.normalise(features)
        drop = [None] * (1 + len(self.high)) if masks is None else list(masks)
        low = self.low(normalised, drop[0])
        share = self.weights(features[..., -SHAPES:])  # (N, T, K)
        high = sum(
            share[..., k, None] * net(normalised[..., :-SHAPES], drop[1 + k])
            for k, net in enumerate(self.high)
        )
        shape = (self.vertices, 3)
        return (self.output_scale * low).unflatten(-1, shape), (self.output_scale * high).unflatten(-1, shape)

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        low, high = self.bands(features, state)
        return low + high, None

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layers whose sum the offsets are."""
        return (self.low.last, *(cast(_Perceptron, net).last for net in self.high))

    def lay_out(self, plan: FramePlan) -> None:
        """Add the operations of `forward` for one frame to the plan.

        Raises:
            ValueError: for several pivots, which no model file has.
        """
        if len(self.high) > 1:
            raise ValueError(f"a network of {len(self.high)} pivots has no compiled frame: use one pivot")
        x = plan.add_normalised(self)
        high = cast(_Perceptron, self.high[0])
        pose = slice(x.start, x.stop - SHAPES)
        plan.add_offsets(self, self.low.lay_out(plan, x), high.lay_out(plan, pose))
