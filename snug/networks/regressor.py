"""The regressor R of SNUG: a recurrent network of the body's motion.

    M(beta, phi) = W(T + R(beta, phi), J(beta), theta, W_G)                      (paper, eq. 1 and 2)

Four gated recurrent units of 256 with tanh and one linear layer to 3V offsets (paper, section 3.5). The
state at the start is zero at run time; in training N(0, sigma) is added to it, sigma being a recipe's
choice.
"""

from __future__ import annotations

from torch import Tensor, nn

from snug.kernels.gru import run_gru, run_linear
from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork


class Regressor(GarmentNetwork):
    """SNUG's recurrent network; the state (layers, N, hidden) is that of its gated recurrent units."""

    feature_set = "motion"
    sequential = True

    hidden, layers = 256, 4

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__(inputs, vertices)
        self.gru = nn.GRU(inputs, self.hidden, self.layers, batch_first=True)
        self.offsets = nn.Linear(self.hidden, 3 * vertices)

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return offsets (N, T, V, 3) [m] and the state after the last frame."""
        hidden, state = run_gru(self.gru, self.normalise(features), state, closed_form=self.closed_form)
        flat = self.output_scale * run_linear(self.offsets, hidden, closed_form=self.closed_form)
        return flat.unflatten(-1, (self.vertices, 3)), state

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        plan.add_offsets((self.offsets, plan.add_gru(self.gru, x)))
