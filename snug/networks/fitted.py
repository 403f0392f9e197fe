"""Learners without training steps: the nearest training poses, and ridge regression on principal components.

    nearest poses:  offsets(theta) = sum_k w_k offsets_k,  w_k ~ 1 / |r(theta) - r_k|^2
    regression:     offsets(theta) = mean + D W (r(theta) - mean)

over the K nearest r_k, and with principal components D of the offsets. Both learn offsets of the unposed
garment from simulated frames in one go. r are the numbers of a pose (DressedBody.features): for the first
up in the root's axes and two columns of each joint's rotation as they are.
"""

from __future__ import annotations

from typing import Any, cast

import torch
from torch import Tensor, nn

from snug.networks.frame_layout import FramePlan
from snug.networks.garment_network import GarmentNetwork, seeded
from snug.networks.pbns import PoseSpaceDeformation

NEIGHBOURS = 4
NEAR = 1e-8  # squared distance of two poses below which they are one
COMPONENTS = 64
RIDGE = 0.1  # of the squared weights against the mean squared error; inputs are as they are
PASSES = 4  # of the subspace iteration that finds the principal components (Halko et al. 2011)


class NearestPoses(GarmentNetwork):
    """The training frames themselves: their poses (F, D) and offsets (F, 3 V) [m]. No state."""

    feature_set = "pose"
    sequential = False

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__(inputs, vertices)
        self._keep(torch.zeros(NEIGHBOURS, inputs), torch.zeros(NEIGHBOURS, 3 * vertices))

    def _keep(self, poses: Tensor, offsets: Tensor) -> None:
        self.poses = nn.Parameter(poses, requires_grad=False)
        self.frames = nn.Parameter(offsets, requires_grad=False)

    def _load_from_state_dict(self, state_dict: dict[str, Tensor], prefix: str, *rest: Any) -> None:
        """Make room for as many frames as there are, then load."""
        count = len(state_dict[f"{prefix}poses"])
        self._keep(
            self.poses.new_zeros(count, self.poses.shape[1]),
            self.frames.new_zeros(count, 3 * self.vertices),
        )
        super()._load_from_state_dict(state_dict, prefix, *rest)

    def learn(self, features: Tensor, offsets: Tensor) -> None:
        """Keep the frames; the inputs stay as they are."""
        if len(features) < NEIGHBOURS:
            raise ValueError(f"{len(features)} training frames: nearest poses need {NEIGHBOURS}")
        self._keep(features, offsets.flatten(1) / self.output_scale)

    def forward(self, features: Tensor, state: None = None) -> tuple[Tensor, None]:
        """Return offsets (N, T, V, 3) [m] and no state."""
        poses = self.normalise(features).flatten(0, -2)
        distances = torch.cdist(poses, self.poses, compute_mode="donot_use_mm_for_euclid_dist").square()
        nearest, rows = distances.topk(NEIGHBOURS, largest=False)
        weights = 1.0 / (nearest + NEAR)
        weights /= weights.sum(-1, keepdim=True)
        flat = self.output_scale * (weights[..., None] * self.frames[rows]).sum(1)
        return flat.unflatten(0, features.shape[:-1]).unflatten(-1, (self.vertices, 3)), None

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return none: no layer has been drawn at random."""
        return ()

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan."""
        plan.add_nearest(self.poses, self.frames, x, NEIGHBOURS, NEAR)


class PoseRegression(PoseSpaceDeformation):
    """A linear map from the pose to coefficients of principal components: PBNS with nothing in between."""

    widths = (COMPONENTS,)
    activation = nn.Identity
    constant = True

    def learn(self, features: Tensor, offsets: Tensor, *, ridge: float = RIDGE) -> None:
        """Find the components, and the least squared error of their coefficients with a ridge penalty."""
        flat = offsets.flatten(1) / self.output_scale
        centre, count = flat.mean(0), min(self.widths[0], *flat.shape)
        with seeded(0):
            directions = torch.pca_lowrank(flat - centre, count, center=False, niter=PASSES)[2]  # (3V, K)
        coefficients = ((flat - centre) @ directions).double()
        x_mean = features.double().mean(0)
        x = features.double() - x_mean
        penalty = ridge * len(x) * torch.eye(x.shape[1], dtype=x.dtype)
        weights = torch.linalg.lstsq(
            x.T @ x + penalty, x.T @ coefficients, driver="gelsd"
        ).solution  # (D, K)
        first = cast(nn.Linear, self.activations[0])
        with torch.no_grad():
            for parameter in self.parameters():
                parameter.zero_()
            first.weight[:count], first.bias[:count] = weights.T.float(), -(x_mean @ weights).float()
            self.offsets.weight[:, :count], self.offsets.bias[:] = directions, centre
