"""Neural Cloth Simulation (Bertiche et al. 2022): a static and a dynamic branch whose codes are added.

    offsets_t = D(z_s + z_d),   z_s = static encoder(pose_t),   z_d = GRU(dynamic encoder(motion_1..t))

Nothing in the dynamic branch has a bias, and the motion of a body at rest is zero: where nothing has
moved, the garment is D(z_s). In training a fifth of a batch has codes z_d of other windows.

The inputs are of the joints near a garment:

    pose of a joint:    two columns of its rotation R, and the direction of gravity in its axes
    motion of a joint:  rates of both, and the acceleration of its position in its axes

The pelvis differs from the authors' inputs: its rotation is left out of the pose, and the rate of it is
taken in its own axes, so that it does not matter where north is.
"""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from torch import Tensor, nn

from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT, rotation_matrices
from snug.motion.motion import Motion
from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork, perceptron

# Of the published configuration for SMPL what carries clothes: no shanks, feet, hands and head.
DESCRIBED = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "spine3", "neck",
    "left_collar", "right_collar", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
)  # fmt: skip
POSE_NUMBERS = 6 * (len(DESCRIBED) - 1) + 3 * len(DESCRIBED)
RATES = 12  # numbers of the motion of one joint


def joint_motion(
    body: Body, motion: Motion, betas: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return pose (T, 129) and motion (T, 15 x 12) of DESCRIBED joints, by backward differences.

    The first frame is at rest. Rotations have no unit, rates are [1/s], accelerations [m/s^2].

    Source:
        H. Bertiche, M. Madadi and S. Escalera, Neural cloth simulation, ACM Transactions on Graphics 41
        (2022), article 220.
    """
    joints, fps = [JOINT[name] for name in DESCRIBED], motion.fps
    transforms = body.transforms(motion.poses, motion.translations, betas)[:, joints]
    world, shifts = transforms[..., :3], transforms[..., 3]
    positions = np.einsum("tjab,jb->tja", world, body.joints(betas)[joints]) + shifts
    rotations, down = rotation_matrices(motion.poses[:, joints]), -world[:, :, 1]  # R^T (-e_y)
    turning = _rate(rotations, fps)
    turning[:, 0] = rotations[:, 0].swapaxes(-1, -2) @ turning[:, 0]
    acceleration = np.einsum("tjba,tjb->tja", world, _rate(_rate(positions, fps), fps))
    frames = motion.frames
    pose = [_columns(rotations[:, 1:]).reshape(frames, -1), down.reshape(frames, -1)]
    rates = [_columns(turning), _rate(down, fps), acceleration]
    return np.concatenate(pose, axis=1), np.concatenate(rates, axis=2).reshape(frames, -1)


def _rate(values: np.ndarray, fps: float) -> np.ndarray:
    """Return the change of values (T, ...) in a second; zero in the first frame."""
    return np.diff(values, axis=0, prepend=values[:1]) * fps


def _columns(matrices: np.ndarray) -> np.ndarray:
    """Return the first two columns of matrices (T, J, 3, 3), (T, J, 6)."""
    return matrices[..., :2].swapaxes(-1, -2).reshape(*matrices.shape[:2], 6)


STATIC_WIDTHS = (64, 128, 256, 512)
JOINT_WIDTHS = (32, 32)  # of layers that all joints share
# Width of the codes, of the other layers of the dynamic branch, and of the decoder.
WIDTH = 512
DECODER_LAYERS = 3
# frames: with a window of three the recurrent units see 16, half a second of rates at 30 a second
LEAD = 13
EXCHANGED = 0.2  # share of a batch
JUDGED_BY_INERTIA = 2  # first frame of a window that has inertia


class TwoBranches(GarmentNetwork):
    """Both branches; the state (1, N, 512) is that of the dynamic branch, and its last code."""

    feature_set = "joint_motion"
    sequential = True
    lead = LEAD

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__(inputs, vertices)
        self.static_encoder = perceptron(POSE_NUMBERS, *STATIC_WIDTHS)
        self.decoder = perceptron(WIDTH, *[WIDTH] * DECODER_LAYERS)
        self.offsets = nn.Linear(WIDTH, 3 * vertices, bias=False)
        self.joint_encoder = perceptron(RATES, *JOINT_WIDTHS, bias=False)
        joints = len(DESCRIBED) * JOINT_WIDTHS[-1]
        self.dynamic_encoder = perceptron(joints, WIDTH, WIDTH, bias=False)
        self.gru = nn.GRU(WIDTH, WIDTH, bias=False, batch_first=True)

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

    def dynamic_code(self, features: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor]:
        """Return z_d (N, T, 512) of features (N, T, D), and the state after the last frame."""
        rates = self.normalise(features)[..., POSE_NUMBERS:].unflatten(-1, (len(DESCRIBED), RATES))
        return self.gru(self.dynamic_encoder(self.joint_encoder(rates).flatten(-2)), state)

    def state_after(self, features: Tensor) -> Tensor:
        """Return the state after frames with features (N, T, D), the first of which begins from zero."""
        return self.dynamic_code(features, None)[1]

    def forward(self, features: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return offsets (N, T, V, 3) [m] and the state after the last frame.

        In training the first windows have codes z_d of each other. Their frames from the third on, which
        have inertia, have no gradient; nor has their past where it is detached (Recipe.inertia_form).
        """
        static = self.static_code(features)
        dynamic, after = self.dynamic_code(features, state)
        count = round(EXCHANGED * len(features)) if self.training else 0
        if count < 2:
            return self.decode(static + dynamic), after
        # Windows are drawn at random.
        strange = static[:count].detach() + dynamic[:count].detach().roll(1, 0)
        offsets = self.decode(torch.cat([strange, static[count:] + dynamic[count:]]))
        early, late = offsets[:count].tensor_split([JUDGED_BY_INERTIA], dim=1)
        return torch.cat([torch.cat([early, late.detach()], 1), offsets[count:]]), after

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        motion = slice(x.start + POSE_NUMBERS, x.stop)
        for layer in self.joint_encoder:
            if isinstance(layer, nn.Linear):
                motion = plan.add_linear(_repeat(layer, len(DESCRIBED)), motion, nn.ReLU)
        code = plan.add_layers(self.static_encoder, slice(x.start, x.start + POSE_NUMBERS))
        plan.add_sum(code, plan.add_gru(self.gru, plan.add_layers(self.dynamic_encoder, motion)))
        plan.add_offsets((self.offsets, plan.add_layers(self.decoder, code)))


def _repeat(layer: nn.Linear, count: int) -> nn.Linear:
    """Return a layer without bias that does the same to each of `count` pieces of its inputs."""
    wide_layer = nn.Linear(count * layer.in_features, count * layer.out_features, bias=False)
    wide_layer.weight = nn.Parameter(torch.block_diag(*[cast(Tensor, layer.weight.detach())] * count))
    return wide_layer
