"""A static network of handles: from the pose to one affine transform for each, which move the garment.

    offsets(theta)_v = sum_b w_b(v) A_b(theta) [(r_v - c_b) / h; 1]        (shape_functions)

A small perceptron gives the twelve numbers of each A_b. So it has a tenth of SNUG's weights, and what it can
express is the span of the shape functions (method `handles-80-floor`), whatever it has learned. Like PBNS it
sees one pose and no motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import torch
from torch import Tensor, nn

from snug.networks.garment_network import GarmentNetwork, perceptron
from snug.networks.handles.shape_functions import shape_functions, span

if TYPE_CHECKING:
    from snug.garments.garment import Garment
    from snug.networks.frame_layout import FramePlan

WIDTHS = (256, 256)


class HandleNetwork(GarmentNetwork):
    """A perceptron of the pose whose output moves `handles` handles, without a state.

    Attributes:
        functions: (V, handles, 4), of `shape_functions`; not trained, and zero until `wear`.
    """

    feature_set = "pose"
    sequential = False
    handles: ClassVar[int]

    def __init__(self, inputs: int, vertices: int, *, output_scale: float = 1.0) -> None:
        super().__init__(inputs, vertices, output_scale=output_scale)
        self.activations = perceptron(inputs, *WIDTHS, activation=nn.SiLU)
        self.numbers = nn.Linear(WIDTHS[-1], 12 * self.handles)
        self.functions = nn.Parameter(torch.zeros(vertices, self.handles, 4), requires_grad=False)

    def wear(self, garment: Garment) -> None:
        """Place the handles on the garment. Raises HandleError where it cannot have as many."""
        self.functions.data.copy_(torch.from_numpy(shape_functions(garment, self.handles)))

    def forward(self, features: Tensor, state: None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        numbers = self.output_scale * self.numbers(self.activations(self.normalise(features)))
        coordinates = numbers.unflatten(-1, (3, 4 * self.handles)) @ self.functions.flatten(1).T
        return coordinates.transpose(-1, -2), None

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layer whose zeros are no offsets."""
        return (self.numbers,)

    def offset_space(self) -> tuple[Tensor, Tensor]:
        """Return the offsets that handles can express: basis (3 V, 12 handles), and zero as centre (3 V,)."""
        basis = span(self.functions.detach().numpy())
        return torch.from_numpy(basis), self.functions.new_zeros(3 * self.vertices)

    def lay_out(self, plan: FramePlan) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        x = plan.add_layers(self.activations, plan.add_normalised(self))
        plan.add_handles(self, self.functions, plan.add_linear(self.numbers, x))


class Handles20(HandleNetwork):
    """Twenty handles."""

    handles = 20


class Handles40(HandleNetwork):
    """Forty handles."""

    handles = 40


class Handles80(HandleNetwork):
    """Eighty handles."""

    handles = 80
