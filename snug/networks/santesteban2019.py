"""Santesteban et al. 2019, "Learning-based animation of clothing": a fit by shape plus wrinkles by motion.

    offsets(beta, theta_1..t) = fit(beta) + wrinkles(beta, theta_1..t)
    fit: 10 -> 20 (ReLU) -> 3V,   wrinkles: one GRU of 1500, one linear layer to 3V

taught by simulated vertices, as the supervised network is (snug.training.vertex_targets). Its authors train the
two parts one after the other, the fit on drapes of many bodies in one pose; here both are trained together on
the simulated motions. Those show one body shape, the mean one: the fit reads a constant and can only give a
constant, a mean drape that the last layer's bias could hold as well. Its numbers say nothing of how it would
do on other bodies. The 2 mm clean-up of its authors is a method of its own, see benchmarks.methods.networks.collision_post_processing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import torch
from torch import Tensor, nn

from snug.body.parametric_body import SHAPES
from snug.kernels.gru import run_gru, run_linear
from snug.networks.regressor import Regressor

if TYPE_CHECKING:
    from snug.networks.one_frame import FramePlan

FIT, HIDDEN = 20, 1500


class FitAndWrinkles(nn.Module):
    """features (N, T, D), the last ten of them the shape -> offsets (N, T, V, 3) [m], and the state."""

    def __init__(
        self, inputs: int, vertices: int, *, output_scale: float = 1.0, zero_last_layer: bool = False
    ) -> None:
        super().__init__()
        self.vertices, self.output_scale, self.closed_form = vertices, output_scale, False
        self.input_mean: Tensor
        self.input_std: Tensor
        self.register_buffer("input_mean", torch.zeros(inputs))
        self.register_buffer("input_std", torch.ones(inputs))
        drape = nn.Linear(FIT, 3 * vertices)
        self.fit = nn.Sequential(nn.Linear(SHAPES, FIT), nn.ReLU(), drape)
        self.gru = nn.GRU(inputs, HIDDEN, batch_first=True)
        self.offsets = nn.Linear(HIDDEN, 3 * vertices)
        if zero_last_layer:
            for layer in (drape, self.offsets):
                nn.init.zeros_(layer.weight)
                nn.init.zeros_(layer.bias)

    normalise_by = Regressor.normalise_by
    random_state = Regressor.random_state

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        normalised = (features - self.input_mean) / self.input_std  # (N, T, D)
        fast, drape = self.closed_form, cast(nn.Linear, self.fit[-1])
        hidden, state = run_gru(self.gru, normalised, state, closed_form=fast)  # (N, T, 1500), (1, N, 1500)
        shape = self.fit[:-1](normalised[..., -SHAPES:])
        flat = run_linear(drape, shape, closed_form=fast) + run_linear(self.offsets, hidden, closed_form=fast)
        return (self.output_scale * flat).unflatten(-1, (self.vertices, 3)), state

    def lay_out(self, plan: FramePlan) -> None:
        """`forward` for one frame."""
        x = plan.normalised(self)
        first, _, drape = self.fit
        shape = plan.linear(first, slice(x.stop - SHAPES, x.stop), nn.ReLU)
        plan.offsets(self, (drape, shape), (self.offsets, plan.gru(self.gru, x)))
