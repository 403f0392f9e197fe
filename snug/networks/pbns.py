"""PBNS: a pose goes through a small perceptron into a pose-space deformation (Bertiche et al. 2021).

    offsets(theta) = sum_i a_i(theta) D_i,   a: four layers of 32 with ReLU,   D: (32, V, 3)

It sees one pose and no motion, one body shape, and learns from the static energies alone. With StVK for
membrane strain it is what the SNUG paper calls the extended PBNS.
"""

from __future__ import annotations

from torch import Tensor, nn

from snug.kernels.gru import run_linear
from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork, perceptron

WIDTHS = (32,) * 4


class PoseSpaceDeformation(GarmentNetwork):
    """A perceptron and a matrix of deformations, without a state."""

    feature_set = "pose"
    sequential = False

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__(inputs, vertices)
        self.activations = perceptron(inputs, *WIDTHS)
        # The deformation matrix, (width, V, 3) flattened.
        self.offsets = nn.Linear(WIDTHS[-1], 3 * vertices, bias=False)

    def forward(self, features: Tensor, state: None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        hidden = self.activations(self.normalise(features))
        flat = self.output_scale * run_linear(self.offsets, hidden)
        return flat.unflatten(-1, (self.vertices, 3)), None

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        x = plan.add_layers(self.activations, x)
        plan.add_offsets((self.offsets, x))
