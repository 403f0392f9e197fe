"""Santesteban et al. 2019, "Learning-based animation of clothing": a fit by shape plus wrinkles by motion.

    offsets(beta, theta_1..t) = fit(beta) + wrinkles(beta, theta_1..t)
    fit: 10 -> 20 (ReLU) -> 3V,   wrinkles: one GRU of 1500, one linear layer to 3V

It learns simulated vertices. Its authors train the two parts one after the other, the fit on drapes of many
bodies in one pose; here both are trained together on the simulated motions of the mean body, so the fit can
only give a constant. The authors' collision post-processing (2 mm) is no part of the network.
"""

from __future__ import annotations

from typing import cast

from torch import Tensor, nn

from snug.body.parametric_body import SHAPES
from snug.kernels.gru import run_gru, run_linear
from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork

FIT_WIDTH, WRINKLE_WIDTH = 20, 1500


class FitAndWrinkles(GarmentNetwork):
    """A perceptron of the shape, the last ten features, and a recurrent network of all features."""

    feature_set = "pose_shape"
    sequential = True

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__(inputs, vertices)
        self.fit = nn.Sequential(
            nn.Linear(SHAPES, FIT_WIDTH), nn.ReLU(), nn.Linear(FIT_WIDTH, 3 * vertices)
        )
        self.gru = nn.GRU(inputs, WRINKLE_WIDTH, batch_first=True)
        self.offsets = nn.Linear(WRINKLE_WIDTH, 3 * vertices)

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return offsets (N, T, V, 3) [m] and the state (1, N, 1500) after the last frame."""
        normalised = self.normalise(features)
        fast, drape = self.closed_form, cast(nn.Linear, self.fit[-1])
        # (N, T, 1500), (1, N, 1500)
        hidden, state = run_gru(self.gru, normalised, state, closed_form=fast)
        shape = self.fit[:-1](normalised[..., -SHAPES:])
        flat = run_linear(drape, shape, closed_form=fast) + run_linear(
            self.offsets, hidden, closed_form=fast
        )
        return (self.output_scale * flat).unflatten(-1, (self.vertices, 3)), state

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layers whose sum the offsets are."""
        return cast(nn.Linear, self.fit[-1]), self.offsets

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        first, drape = cast(nn.Linear, self.fit[0]), cast(nn.Linear, self.fit[2])
        shape = plan.add_linear(first, slice(x.stop - SHAPES, x.stop), nn.ReLU)
        plan.add_offsets((drape, shape), (self.offsets, plan.add_gru(self.gru, x)))
