"""A body and its garment as tensors of a network: inputs, joint transforms, skinned vertices.

Everything a network or its loss sees is relative to the pelvis (the posed joint 0) of its own frame,
where float32 keeps its digits and the energy of gravity is zero. The pelvis is added in float64.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from snug.body.parametric_body import SHAPES, Body
from snug.body.skeleton import rotation_matrices
from snug.body.skinning import skin
from snug.garments.garment import Garment, smooth_weights
from snug.motion.motion import Motion
from snug.networks.ncs import joint_motion
from snug.recipe import Recipe

# The sets of inputs, and the earlier frames that each is made from, for first and second differences.
FEATURE_SETS = {"motion": 1, "pose": 0, "pose_shape": 0, "joint_motion": 2}


class DressedBody:
    """A garment on a body; every motion is given to the methods.

    The rest state of all energies is the garment's, for every body shape: the same shirt on a larger body
    is a stretched shirt.
    """

    def __init__(self, body: Body, garment: Garment) -> None:
        self.body, self.garment = body, garment
        self.cloth = garment.cloth()
        self.vertices = len(garment.rest_positions)
        self.parents = body.parents.tolist()
        self._weights: dict[int, Tensor] = {}

    def weights(self, smoothing: int) -> Tensor:
        """Return skinning weights (V, 24), borrowed from the body and averaged over neighbours.

        smoothing: sweeps at 1000 vertices. A sweep reaches as far as an edge is long, so that other
        garments get sweeps in proportion to their vertices, and are smoothed over the same length.
        """
        if smoothing not in self._weights:
            borrowed = weights = self.garment.skinning_weights
            if smoothing:
                sweeps = max(1, round(smoothing * self.vertices / 1000))
                weights = smooth_weights(weights, self.garment.faces, sweeps)
                # Where the simulator's handles are.
                weights[self.garment.pins] = borrowed[self.garment.pins]
            self._weights[smoothing] = torch.as_tensor(weights, dtype=torch.float32)
        return self._weights[smoothing]

    def rest(self, betas: np.ndarray | None = None) -> Tensor:
        """Return the unposed garment without offsets, (V, 3) [m], on the body of shape (S,).

        Shapes (N, S) give (N, V, 3); None is the mean body.
        """
        mean = torch.as_tensor(self.garment.rest_positions, dtype=torch.float32)
        if betas is None:
            return mean
        shapes = torch.as_tensor(betas, dtype=torch.float32)
        if shapes.shape[-1] != (count := len(self.rest_directions)):
            raise ValueError(f"betas {tuple(shapes.shape)}: expected (..., {count})")
        return mean + torch.einsum("...s,svi->...vi", shapes, self.rest_directions)

    @cached_property
    def rest_directions(self) -> Tensor:
        """Displacement of the unposed garment by one unit of each shape number, (10, V, 3) [m]."""
        # The garment follows the body linearly, so one call for each direction tells all shapes.
        units = np.eye(self.body.shape_count)
        moved = [self.garment.rest_for(self.body, unit) - self.garment.rest_positions for unit in units]
        return torch.as_tensor(np.stack(moved), dtype=torch.float32)

    def pelvis(self, motion: Motion, betas: np.ndarray | None = None) -> np.ndarray:
        """Return the world position of the pelvis in each frame, (T, 3) [m] float64."""
        return self.body.joints(betas)[0] + motion.translations

    def transforms(self, poses: np.ndarray, betas: np.ndarray | None = None) -> Tensor:
        """Return rest-to-posed transforms (T, 24, 3, 4) of the joints, relative to the pelvis.

        poses: (T, 24, 3) [rad].
        """
        home = np.tile(-self.body.joints(betas)[0], (len(poses), 1))
        return torch.from_numpy(self.body.transforms(poses, home, betas)).float()

    def features(
        self,
        motion: Motion,
        recipe: Recipe,
        betas: np.ndarray | None = None,
        *,
        feature_set: str = "motion",
        still: bool = False,
    ) -> Tensor:
        """Return the inputs (T, D) of a network, float32; `still`: as if each pose were held.

        Sets are `pose`; `motion`: pose, root velocity and shape; `pose_shape`: pose and shape, with zeros
        behind it up to SHAPES numbers; `joint_motion`: pose and rates of single joints
        (snug.networks.ncs). The recipe gives the form of the pose and the axes of the velocity.
        """
        if feature_set == "joint_motion":
            pose, rates = joint_motion(self.body, motion, betas)
            parts = [pose, rates * (not still)]
            return torch.from_numpy(np.concatenate(parts, axis=1).astype(np.float32))
        rotations = rotation_matrices(motion.poses)
        parts = [_pose_numbers(motion.poses, rotations, recipe.pose_input)]
        if feature_set == "motion":
            # Zero in the first frame, which has no past.
            velocity = np.diff(motion.translations, axis=0, prepend=motion.translations[:1]) * motion.fps
            if recipe.velocity_frame == "root":
                velocity = np.einsum("tji,tj->ti", rotations[:, 0], velocity)
            parts.append(velocity * (not still))
        if feature_set in ("motion", "pose_shape"):
            shape = np.zeros(self.body.shape_count) if betas is None else betas
            if feature_set == "pose_shape":
                shape = np.pad(shape, (0, SHAPES - len(shape)))
            parts.append(np.broadcast_to(shape, (motion.frames, len(shape))))
        return torch.from_numpy(np.concatenate(parts, axis=1).astype(np.float32))

    def skin(
        self,
        motion: Motion,
        betas: np.ndarray | None = None,
        *,
        smoothing: int = 0,
        offsets: Tensor | None = None,
    ) -> np.ndarray:
        """Return world vertices (T, V, 3) [m], float64: the unposed garment plus offsets, skinned."""
        unposed = self.rest(betas) if offsets is None else self.rest(betas) + offsets
        posed = skin(unposed, self.weights(smoothing), self.transforms(motion.poses, betas))
        return posed.double().numpy() + self.pelvis(motion, betas)[:, None]


def _pose_numbers(poses: np.ndarray, rotations: np.ndarray, pose_input: str) -> np.ndarray:
    """Return (T, 72) axis-angle numbers, or (T, 141): up in the root's axes and 6 numbers a joint.

    Those are the first two columns of its rotation (Zhou et al. 2019, "On the continuity of rotation
    representations in neural networks").
    """
    if pose_input == "axis_angle":
        return poses.reshape(len(poses), -1)
    up = rotations[:, 0, 1, :]  # R^T e_y: the same for a walk to the east and to the north
    columns = rotations[:, 1:, :, :2].swapaxes(-1, -2)
    return np.concatenate([up, columns.reshape(len(poses), -1)], axis=1)
