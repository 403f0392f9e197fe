"""Neural Cloth Simulation (Bertiche et al. 2022): a static and a dynamic branch whose codes are added.

    offsets_t = D(z_s + z_d),   z_s = static encoder(pose_t),   z_d = GRU(dynamic encoder(motion_1..t))

Nothing in the dynamic branch has a bias, and the motion of a body at rest is zero: where nothing has moved,
z_d is zero and the garment is D(z_s). So the branches are apart by their form, without a loss of their own.
In training a fifth of a batch has codes z_d of other windows (motion augmentation). These windows teach the
decoder alone, and by the static energies alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
import torch
from torch import Tensor, nn

from snug.networks.garment_network import GarmentNetwork, perceptron
from snug.networks.ncs.joint_motion import DESCRIBED, POSE_NUMBERS, RATES

if TYPE_CHECKING:
    from snug.networks.frame_layout import FramePlan

STATIC_WIDTHS = (64, 128, 256, 512)
JOINT_WIDTHS = (32, 32)  # of layers that all joints share
WIDTH = 512  # of the codes, of the other layers of the dynamic branch, and of the decoder
DECODER_LAYERS = 3
LEAD = 13  # frames: with a window of three the recurrent units see 16, half a second of rates at 30 a second
EXCHANGED = 0.2  # share of a batch
JUDGED_BY_INERTIA = 2  # first frame of a window that has inertia


class StaticBranch(GarmentNetwork):
    """The static encoder and the decoder alone: from a pose to offsets, without a state."""

    feature_set = "joint_motion"
    sequential = False

    def __init__(self, inputs: int, vertices: int, *, output_scale: float = 1.0) -> None:
        super().__init__(inputs, vertices, output_scale=output_scale)
        self.static_encoder = perceptron(POSE_NUMBERS, *STATIC_WIDTHS)
        self.decoder = perceptron(WIDTH, *[WIDTH] * DECODER_LAYERS)
        self.offsets = nn.Linear(WIDTH, 3 * vertices, bias=False)

    def normalise_by(self, mean: np.ndarray, std: np.ndarray) -> None:
        """Set mean (D,) and spread (D,) of the inputs; the zero of the motion stays a body at rest."""
        super().normalise_by(np.where(np.arange(len(mean)) < POSE_NUMBERS, mean, 0.0), std)

    def static_code(self, features: Tensor) -> Tensor:
        """Return z_s (N, T, 512) of features (N, T, D)."""
        return self.static_encoder(self.normalise(features)[..., :POSE_NUMBERS])

    def decode(self, code: Tensor) -> Tensor:
        """Return offsets (N, T, V, 3) [m] of codes (N, T, 512)."""
        flat = self.output_scale * self.offsets(self.decoder(code))
        return flat.unflatten(-1, (self.vertices, 3))

    def forward(self, features: Tensor, state: None = None) -> tuple[Tensor, Tensor | None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        return self.decode(self.static_code(features)), None

    def lay_out(self, plan: FramePlan) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        self._lay_out_decoder(plan, self._lay_out_static(plan, plan.add_normalised(self)))

    def _lay_out_static(self, plan: FramePlan, x: slice) -> slice:
        return plan.add_layers(self.static_encoder, slice(x.start, x.start + POSE_NUMBERS))

    def _lay_out_decoder(self, plan: FramePlan, code: slice) -> None:
        plan.add_offsets(self, (self.offsets, plan.add_layers(self.decoder, code)))


class TwoBranches(StaticBranch):
    """Both branches; the state (1, N, 512) is that of the dynamic branch, and its last code."""

    sequential = True
    lead = LEAD

    def __init__(self, inputs: int, vertices: int, *, output_scale: float = 1.0) -> None:
        super().__init__(inputs, vertices, output_scale=output_scale)
        self.joint_encoder = perceptron(RATES, *JOINT_WIDTHS, bias=False)
        joints = len(DESCRIBED) * JOINT_WIDTHS[-1]
        self.dynamic_encoder = perceptron(joints, WIDTH, WIDTH, bias=False)
        self.gru = nn.GRU(WIDTH, WIDTH, bias=False, batch_first=True)

    def dynamic_code(self, features: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor]:
        """Return z_d (N, T, 512) of features (N, T, D), and the state after the last frame."""
        rates = self.normalise(features)[..., POSE_NUMBERS:].unflatten(-1, (len(DESCRIBED), RATES))
        return self.gru(self.dynamic_encoder(self.joint_encoder(rates).flatten(-2)), state)

    def state_after(self, features: Tensor) -> Tensor:
        """Return the state after frames with features (N, T, D), the first of which begins from zero."""
        return self.dynamic_code(features, None)[1]

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return offsets (N, T, V, 3) [m] and the state after the last frame.

        In training the first windows have codes z_d of each other. Their frames from the third on, which have
        inertia, have no gradient; nor has their past where it is detached (Recipe.inertia_form).
        """
        static = self.static_code(features)
        dynamic, after = self.dynamic_code(features, state)
        count = round(EXCHANGED * len(features)) if self.training else 0
        if count < 2:
            return self.decode(static + dynamic), after
        strange = static[:count].detach() + dynamic[:count].detach().roll(1, 0)  # windows are drawn at random
        offsets = self.decode(torch.cat([strange, static[count:] + dynamic[count:]]))
        early, late = offsets[:count].tensor_split([JUDGED_BY_INERTIA], dim=1)
        return torch.cat([torch.cat([early, late.detach()], 1), offsets[count:]]), after

    def lay_out(self, plan: FramePlan) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        x = plan.add_normalised(self)
        motion = slice(x.start + POSE_NUMBERS, x.stop)
        for layer in self.joint_encoder:
            if isinstance(layer, nn.Linear):
                motion = plan.add_linear(_repeated(layer, len(DESCRIBED)), motion, nn.ReLU)
        code = self._lay_out_static(plan, x)
        plan.add_sum(code, plan.add_gru(self.gru, plan.add_layers(self.dynamic_encoder, motion)))
        self._lay_out_decoder(plan, code)


def _repeated(layer: nn.Linear, count: int) -> nn.Linear:
    """Return a layer without bias that does the same to each of `count` pieces of its inputs."""
    whole = nn.Linear(count * layer.in_features, count * layer.out_features, bias=False)
    whole.weight = nn.Parameter(torch.block_diag(*[cast(Tensor, layer.weight.detach())] * count))
    return whole
