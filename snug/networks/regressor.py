"""The garment regressor R: body motion to offsets of an unposed garment.

    M(beta, phi) = W(T + R(beta, phi), J(beta), theta, W_G)                      (paper, eq. 1 and 2)

Four gated recurrent units of 256 with tanh and one linear layer to 3V offsets (paper, section 3.5). The state
at the start is zero at run time; in training N(0, sigma) is added to it, sigma being a recipe's choice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from snug.kernels.gru import run_gru, run_linear

if TYPE_CHECKING:
    from snug.networks.one_frame import FramePlan

HIDDEN, LAYERS = 256, 4


class Regressor(nn.Module):
    """features (N, T, D) -> offsets (N, T, V, 3) [m] in the unposed space, and the state to go on with.

    The features are normalised inside, by the mean and spread of the training frames, which are saved with
    the weights: a caller passes plain features and cannot forget it. closed_form: train by
    snug.kernels.gru, on a CPU; the state that comes out then has no gradient.
    """

    def __init__(
        self,
        inputs: int,
        vertices: int,
        *,
        output_scale: float = 1.0,
        zero_last_layer: bool = False,
        hidden: int = HIDDEN,
        layers: int = LAYERS,
    ) -> None:
        super().__init__()
        self.vertices, self.output_scale, self.closed_form = vertices, output_scale, False
        self.input_mean: Tensor
        self.input_std: Tensor
        self.register_buffer("input_mean", torch.zeros(inputs))
        self.register_buffer("input_std", torch.ones(inputs))
        self.gru = nn.GRU(inputs, hidden, layers, batch_first=True)
        self.offsets = nn.Linear(hidden, 3 * vertices)
        if zero_last_layer:
            nn.init.zeros_(self.offsets.weight)
            nn.init.zeros_(self.offsets.bias)

    def normalise_by(self, mean: np.ndarray, std: np.ndarray) -> None:
        """Set the input mean (D,) and spread (D,)."""
        self.input_mean.copy_(torch.as_tensor(mean))
        self.input_std.copy_(torch.as_tensor(std))

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        normalised = (features - self.input_mean) / self.input_std  # (N, T, D)
        hidden, state = run_gru(self.gru, normalised, state, closed_form=self.closed_form)
        flat = self.output_scale * run_linear(self.offsets, hidden, closed_form=self.closed_form)
        return flat.unflatten(-1, (self.vertices, 3)), state

    def lay_out(self, plan: FramePlan) -> None:
        """`forward` for one frame."""
        plan.offsets(self, (self.offsets, plan.gru(self.gru, plan.normalised(self))))

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor:
        """(layers, batch, hidden) drawn from N(0, sigma): so that long roll-outs hold."""
        shape = (self.gru.num_layers, batch, self.gru.hidden_size)
        device = self.input_mean.device
        return sigma * torch.randn(shape, generator=generator, device=generator.device).to(device)


def parameter_megabytes(network: nn.Module) -> float:
    """Memory of the weights and of the input normalisation [MB]."""
    tensors = [*network.parameters(), *network.buffers()]
    return sum(t.numel() * t.element_size() for t in tensors) / 1e6
