"""A network of handles: from the pose to one affine transform for each, which move the garment.

    offsets(theta)_v = sum_b w_b(v) A_b(theta) [(r_v - c_b) / h; 1]        (shape_functions)

A small perceptron that sees one pose, as PBNS does, gives the twelve numbers of each A_b. The offsets are
of the unposed garment r, as SNUG's, which is then skinned. The centres c are farthest
points of the garment, each the vertex that lies farthest from those before it. The weights are compact,
w_b ~ (1 - d_b/R)^4 (4 d_b/R + 1) for distances d_b < R (Wendland 1995), and sum to one in each vertex, so
that equal transforms of all handles move the garment affinely. h is the covering radius, the largest
distance of a vertex from its nearest centre; R = REACH h. Distances are straight.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from snug.garments.garment import Garment
from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork, perceptron

REACH = 2.5  # covering radii


def shape_functions(garment: Garment, handles: int) -> np.ndarray:
    """Return the four functions of each handle at the vertices, (V, handles, 4) float64; zero at pins.

    The first three are w_b (r - c_b) / h, the last is w_b [1].

    Raises:
        ValueError: no handle, or as many as the garment has vertices.
    """
    rest = np.asarray(garment.rest_positions, dtype=np.float64)
    if not 1 <= handles < len(rest):
        raise ValueError(f"{handles} handles: a garment of {len(rest)} vertices has 1 to {len(rest) - 1}")
    centres = farthest_points(rest, handles)
    away = rest[:, None] - rest[centres]
    distances = np.linalg.norm(away, axis=2)
    radius = distances.min(axis=1).max()
    weights = compact_weights(distances, REACH * radius)
    affine = np.concatenate([away / radius, np.ones((*weights.shape, 1))], axis=2)
    functions = weights[..., None] * affine
    functions[np.asarray(garment.pins, dtype=np.int64)] = 0.0
    return functions


def farthest_points(rest: np.ndarray, count: int) -> np.ndarray:
    """Return `count` of the vertices rest (V, 3), (count,): the first is farthest from the mean of all.

    More points keep the first ones.

    >>> farthest_points(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 0, 0]]), 3).tolist()
    [3, 0, 2]
    """
    points = [int(np.argmax(np.linalg.norm(rest - rest.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(rest - rest[points[0]], axis=1)
    while len(points) < count:
        points.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(rest - rest[points[-1]], axis=1))
    return np.array(points)


def compact_weights(distances: np.ndarray, reach: float) -> np.ndarray:
    """Return the weights (V, B) of centres at distances (V, B) [m], of sum one; zero from `reach` [m] on."""
    share = np.minimum(distances / reach, 1.0)
    weights = (1.0 - share) ** 4 * (4.0 * share + 1.0)
    return weights / weights.sum(axis=1, keepdims=True)


WIDTHS = (256, 256)


class Handles(GarmentNetwork):
    """A perceptron of the pose whose output moves `handles` handles, without a state.

    Attributes:
        handles: their number.
        functions: (V, handles, 4), of `shape_functions`; not trained, and zero until `wear`.
        numbers: last layer, from the activations to twelve numbers a handle.
    """

    feature_set = "pose"
    sequential = False

    def __init__(self, inputs: int, vertices: int, handles: int) -> None:
        super().__init__(inputs, vertices)
        self.activations = perceptron(inputs, *WIDTHS, activation=nn.SiLU)
        self.handles, self.numbers = handles, nn.Linear(WIDTHS[-1], 12 * handles)
        self.functions = nn.Parameter(torch.zeros(vertices, handles, 4), requires_grad=False)

    def wear(self, garment: Garment) -> None:
        """Place the handles on the garment. Raises ValueError where it cannot have as many."""
        self.functions.data.copy_(torch.from_numpy(shape_functions(garment, self.handles)))

    def forward(self, features: Tensor, state: None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        numbers = self.output_scale * self.numbers(self.activations(self.normalise(features)))
        coordinates = numbers.unflatten(-1, (3, 4 * self.handles)) @ self.functions.flatten(1).T
        return coordinates.transpose(-1, -2), None

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layer whose zeros are no offsets."""
        return (self.numbers,)

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        x = plan.add_layers(self.activations, x)
        plan.add_handles(self.functions, plan.add_linear(self.numbers, x))
