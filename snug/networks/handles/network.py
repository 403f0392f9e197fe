"""Networks of handles: from the pose or the motion to one affine transform for each, which move the garment.

    offsets(theta)_v = sum_b w_b(v) A_b(theta) [(r_v - c_b) / h; 1]        (shape_functions)

A small network gives the twelve numbers of each A_b: a perceptron that sees one pose, as PBNS does, or
recurrent units that see the motion and their own past, as SNUG's do. So it has a tenth of SNUG's weights, and
what it can express is the span of the shape functions (method `handles-80-floor`), whatever it has learned.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import torch
from torch import Tensor, nn

from snug.kernels.gru import run_gru
from snug.networks.garment_network import GarmentNetwork, perceptron
from snug.networks.handles.shape_functions import shape_functions, span

if TYPE_CHECKING:
    from snug.garments.garment import Garment
    from snug.networks.frame_layout import FramePlan

WIDTHS = (256, 256)


class HandleNetwork(GarmentNetwork):
    """Base of the networks whose output moves `handles` handles.

    Attributes:
        functions: (V, handles, 4), of `shape_functions`; not trained, and zero until `wear`.
        numbers: last layer, from the activations of a subclass to twelve numbers a handle.
    """

    handles: ClassVar[int]

    def _add_handles(self) -> None:
        """Add last layer and shape functions. What a seed draws depends on which layers are added before."""
        self.numbers = nn.Linear(WIDTHS[-1], 12 * self.handles)
        self.functions = nn.Parameter(torch.zeros(self.vertices, self.handles, 4), requires_grad=False)

    def wear(self, garment: Garment) -> None:
        """Place the handles on the garment. Raises HandleError where it cannot have as many."""
        self.functions.data.copy_(torch.from_numpy(shape_functions(garment, self.handles)))

    def moved(self, activations: Tensor) -> Tensor:
        """Return offsets (N, T, V, 3) [m] for the last activations (N, T, width)."""
        numbers = self.output_scale * self.numbers(activations)
        coordinates = numbers.unflatten(-1, (3, 4 * self.handles)) @ self.functions.flatten(1).T
        return coordinates.transpose(-1, -2)

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layer whose zeros are no offsets."""
        return (self.numbers,)

    def offset_space(self) -> tuple[Tensor, Tensor]:
        """Return the offsets that handles can express: basis (3 V, 12 handles), and zero as centre (3 V,)."""
        basis = span(self.functions.detach().numpy())
        return torch.from_numpy(basis), self.functions.new_zeros(3 * self.vertices)


class StaticHandles(HandleNetwork):
    """A perceptron of the pose, without a state."""

    feature_set = "pose"
    sequential = False

    def __init__(self, inputs: int, vertices: int, *, output_scale: float = 1.0) -> None:
        super().__init__(inputs, vertices, output_scale=output_scale)
        self.activations = perceptron(inputs, *WIDTHS, activation=nn.SiLU)
        self._add_handles()

    def forward(self, features: Tensor, state: None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        return self.moved(self.activations(self.normalise(features))), None

    def lay_out(self, plan: FramePlan) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        x = plan.add_layers(self.activations, plan.add_normalised(self))
        plan.add_handles(self, self.functions, plan.add_linear(self.numbers, x))


class DynamicHandles80(HandleNetwork):
    """Eighty handles by recurrent units of the motion, two layers of SNUG's four; the state is theirs."""

    handles = 80
    feature_set = "motion"
    sequential = True

    def __init__(self, inputs: int, vertices: int, *, output_scale: float = 1.0) -> None:
        super().__init__(inputs, vertices, output_scale=output_scale)
        self._add_handles()
        self.gru = nn.GRU(inputs, WIDTHS[-1], len(WIDTHS), batch_first=True)

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return offsets (N, T, V, 3) [m] and the state after the last frame."""
        hidden, state = run_gru(self.gru, self.normalise(features), state, closed_form=self.closed_form)
        return self.moved(hidden), state

    def lay_out(self, plan: FramePlan) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        hidden = plan.add_gru(self.gru, plan.add_normalised(self))
        plan.add_handles(self, self.functions, plan.add_linear(self.numbers, hidden))


class Handles20(StaticHandles):
    """Twenty handles."""

    handles = 20


class Handles40(StaticHandles):
    """Forty handles."""

    handles = 40


class Handles80(StaticHandles):
    """Eighty handles."""

    handles = 80
