"""TailorNet (Patel et al. 2020): the folds of a garment in two bands, each by its own perceptron.

    offsets(theta, beta) = low(theta, beta) + sum_k w_k(beta) high_k(theta)
    w_k(beta) = exp(-|beta - beta_k|^2 / (2 sigma^2)), normalised to sum one

low and every high_k have three layers of 1024 with ReLU, dropout 0.2 after the first; they are taught by L1
in the unposed space: low the diffusion-smoothed offsets of the simulation, high what smoothing took away.
Each high_k belongs to one pivot, a body shape beta_k. With its authors a pivot is a shape and a style of
garment, and distances are those of the garments in one pose; we have no style input, so it is dropped, and
distances are those of the shape numbers. Our simulated motions show the mean body alone: one pivot, of weight
one, is all that they can teach, and memory and run time are those of one pivot instead of twenty. A static
method: it sees one pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from snug.body.parametric_body import SHAPES
from snug.body.skinning import unskin
from snug.networks.regressor import Regressor
from snug.training.vertex_targets import CM2_PER_M2, VertexTargets

if TYPE_CHECKING:
    from snug.networks.one_frame import FramePlan
    from snug.training.training_set import Batch

WIDTH, DROPOUT = 1024, 0.2
SIGMA = 1.0  # of the kernel, in units of the shape numbers
SMOOTHING, SWEEPS = (
    0.15,
    80,
)  # share of the way to the neighbours' mean in a sweep, and sweeps at 1000 vertices
CM_PER_M = float(np.sqrt(CM2_PER_M2))


class _Perceptron(nn.Module):
    """numbers (N, T, D) -> (N, T, 3V); mask (N, 1, 1024) scales the first layer's activations in training."""

    def __init__(self, inputs: int, outputs: int, *, zero_last_layer: bool) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(inputs, WIDTH), nn.Linear(WIDTH, WIDTH)
        self.last = nn.Linear(WIDTH, outputs)
        if zero_last_layer:
            nn.init.zeros_(self.last.weight)
            nn.init.zeros_(self.last.bias)

    def forward(self, numbers: Tensor, mask: Tensor | None) -> Tensor:
        hidden = torch.relu(self.first(numbers))
        hidden = hidden if mask is None else hidden * mask
        return self.last(torch.relu(self.second(hidden)))

    def lay_out(self, plan: FramePlan, x: slice) -> tuple[nn.Linear, slice]:
        """The last layer, and the place of what it reads, from numbers at x."""
        for layer in (self.first, self.second):
            x = plan.linear(layer, x, nn.ReLU)
        return self.last, x


class FrequencyMixture(nn.Module):
    """features (N, T, D), the last ten of them the shape -> offsets (N, T, V, 3) [m]; no state at run time.

    pivots: (K, 10) body shapes; default the mean body alone.
    """

    def __init__(
        self,
        inputs: int,
        vertices: int,
        *,
        output_scale: float = 1.0,
        zero_last_layer: bool = False,
        pivots: Sequence[Sequence[float]] = ((0.0,) * SHAPES,),
    ) -> None:
        super().__init__()
        self.vertices, self.output_scale = vertices, output_scale
        self.input_mean: Tensor
        self.input_std: Tensor
        self.pivots: Tensor
        self.register_buffer("input_mean", torch.zeros(inputs))
        self.register_buffer("input_std", torch.ones(inputs))
        self.register_buffer("pivots", torch.as_tensor(pivots, dtype=torch.float32))
        self.low = _Perceptron(inputs, 3 * vertices, zero_last_layer=zero_last_layer)
        self.high = nn.ModuleList(
            _Perceptron(inputs - SHAPES, 3 * vertices, zero_last_layer=zero_last_layer) for _ in pivots
        )

    normalise_by = Regressor.normalise_by

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor:
        """Dropout masks (1 + K, N, 1, 1024), drawn from the training's own generator."""
        shape = (1 + len(self.high), batch, 1, WIDTH)
        kept = torch.rand(shape, generator=generator, device=generator.device) >= DROPOUT
        return kept.to(self.input_mean) / (1 - DROPOUT)

    def weights(self, betas: Tensor) -> Tensor:
        """betas (..., 10) -> (..., K), at least zero, of sum one."""
        squared = (betas[..., None, :] - self.pivots).square().sum(-1)
        return torch.softmax(-squared / (2 * SIGMA**2), dim=-1)

    def bands(self, features: Tensor, masks: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Low and high band of the offsets, each (N, T, V, 3) [m]."""
        normalised = (features - self.input_mean) / self.input_std  # (N, T, D)
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
        low, high = self.bands(features, state)
        return low + high, None

    def lay_out(self, plan: FramePlan) -> None:
        """`forward` for one frame. Raises ValueError for several pivots, which no model file has."""
        if len(self.high) > 1:
            raise ValueError(f"a network of {len(self.high)} pivots has no compiled frame: use one pivot")
        x = plan.normalised(self)
        high: Any = self.high[0]
        pose = slice(x.start, x.stop - SHAPES)
        plan.offsets(self, self.low.lay_out(plan, x), high.lay_out(plan, pose))


def smoothed(offsets: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The low band of offsets (T, V, 3) [m]: diffused over the mesh by sweeps with the uniform Laplacian.

    A vertex of an opening moves towards its neighbours along the opening alone, so that openings do not
    shrink. Sweeps in proportion to the vertices reach the same length on any mesh. The rest shape, which no
    band holds, is not smoothed.
    """
    from scipy.sparse import coo_array, diags_array

    count = offsets.shape[1]
    halves = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ordered = np.sort(halves, axis=1)
    edges, uses = np.unique(ordered, axis=0, return_counts=True)
    on_rim = np.zeros(count, dtype=bool)
    on_rim[edges[uses == 1]] = True
    pairs = np.concatenate([edges, edges[:, ::-1]])
    rim = np.concatenate([uses == 1] * 2)
    pairs = pairs[rim | ~on_rim[pairs[:, 0]]]
    near = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()
    mean = diags_array(1.0 / near.sum(axis=1)) @ near
    flat = np.ascontiguousarray(offsets.transpose(1, 0, 2)).reshape(count, -1)
    for _ in range(max(1, round(SWEEPS * count / 1000))):
        flat = (1 - SMOOTHING) * flat + SMOOTHING * (mean @ flat)
    return flat.reshape(count, len(offsets), 3).transpose(1, 0, 2)


def band_loss(predicted: Tensor, target: Tensor) -> Tensor:
    """L1 of one band, (N, T, V, 3) [m] each -> (N, T) [cm]."""
    return CM_PER_M * (predicted - target).abs().sum(-1).mean(-1)


class BandTargets(VertexTargets):
    """The simulated vertices, unposed and taken apart into two bands; arguments as for VertexTargets.

    All of it is in memory, also of trajectories in files: smoothing a batch takes longer than teaching it.
    """

    unit = "cm"
    from_files = False

    def __init__(self, dressed: Any, *arguments: Any) -> None:
        super().__init__(dressed, *arguments)
        assert isinstance(self.vertices, Tensor)
        offsets = unskin(self.vertices, self.weights, self.transforms) - dressed.rest()
        low = smoothed(offsets.numpy(), np.asarray(dressed.garment.faces))
        self.low = torch.as_tensor(low, dtype=torch.float32)
        self.high = offsets - self.low

    def terms(self, network: Any, batch: Batch, state: Any, *_: Any) -> dict[str, Tensor]:
        """Of the offsets, which nothing poses."""
        rows = torch.as_tensor(batch.frames)
        low, high = network.bands(batch.features, state)
        return {"low": band_loss(low, self.low[rows]), "high": band_loss(high, self.high[rows])}
