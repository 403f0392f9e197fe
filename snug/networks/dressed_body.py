"""A body and the garment it wears, as tensors a network works on: inputs, joint transforms, skinned vertices.

Everything a network or its loss sees is relative to the pelvis (the posed joint 0) of its own frame: the
static energies do not depend on where a person stands, float32 keeps its digits, and the zero of gravity is
the pelvis. World positions come back by adding the pelvis, in float64.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from reference_sim.material import Material
from snug.body.parametric_body import SHAPES
from snug.body.skeleton import rotation_matrices
from snug.body.skinning import skin
from snug.networks.inputs import HISTORY, motion_history
from snug.recipes.recipe import Recipe

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.motion.motion import Motion

# Which inputs there are, and the frames before one that they are made from: rates are first and second
# differences.
FEATURE_SETS = {"motion": 1, "pose": 0, "pose_shape": 0, "history": HISTORY + 1}


class DressedBody:
    """What is fixed when a garment is put on a body; every motion is given to its methods.

    body: snug.body.parametric_body.Body; garment: snug.garments.garment.Garment; material: in place of the garment's own. The rest
    state of all energies is the garment's, for every body shape: the same shirt on a larger body is a
    stretched shirt.
    """

    def __init__(self, body: Body, garment: Garment, *, material: Material | None = None) -> None:
        self.body, self.garment = body, garment
        self.cloth = garment.cloth(material)
        self.vertices = len(garment.rest_positions)
        self.parents = [int(parent) for parent in body.parents]
        self._weights: dict[int, Tensor] = {}
        self._rest_directions: Tensor | None = None

    def weights(self, smoothing: int) -> Tensor:
        """Skinning weights (V, 24), borrowed from the body and averaged over neighbours; as they are where
        somebody made them for this garment.

        smoothing: sweeps on a garment of 1000 vertices. A sweep reaches as far as an edge is long, so other
        garments get sweeps in proportion to their vertices and are smoothed over the same length: with 20
        for all, a shirt of 300 vertices is drawn into the body and one of 4400 keeps half of its skinning
        noise.
        """
        if smoothing not in self._weights:
            own = weights = np.asarray(self.garment.skinning_weights)
            if smoothing and not self.garment.authored_weights:
                from snug.garments.garment import smooth_weights

                sweeps = max(1, round(smoothing * self.vertices / 1000))
                weights = smooth_weights(weights, self.garment.faces, sweeps)
                weights[self.garment.pins] = own[self.garment.pins]  # where the simulator's handles are
            self._weights[smoothing] = torch.as_tensor(np.asarray(weights), dtype=torch.float32)
        return self._weights[smoothing]

    def rest(self, betas: np.ndarray | None = None) -> Tensor:
        """The unposed garment (V, 3) [m] on the body of that shape, before any offset; (N, 10) -> (N, V,
        3).
        """
        mean = torch.as_tensor(self.garment.rest_positions, dtype=torch.float32)
        if betas is None:
            return mean
        shapes = torch.as_tensor(np.asarray(betas), dtype=torch.float32)
        return mean + torch.einsum("...s,svi->...vi", shapes, self.rest_directions())

    def rest_directions(self) -> Tensor:
        """What one unit of each shape number adds to the unposed garment, (10, V, 3) [m]."""
        if self._rest_directions is None:
            # The garment follows the body linearly, so one call for each direction tells all shapes.
            units = np.eye(self.body.shape_count)
            moved = [self.garment.rest_for(self.body, unit) - self.garment.rest_positions for unit in units]
            self._rest_directions = torch.as_tensor(np.stack(moved), dtype=torch.float32)
        return self._rest_directions

    def pelvis(self, motion: Motion, betas: np.ndarray | None = None) -> np.ndarray:
        """World position of the pelvis in each frame, (T, 3) [m] float64."""
        return self.body.joints(betas)[0] + motion.translations

    def transforms(self, poses: np.ndarray, betas: np.ndarray | None = None) -> Tensor:
        """Rest-to-posed transforms of the joints relative to the pelvis: (T, 24, 3) [rad] -> (T, 24, 3,
        4).
        """
        home = np.tile(-self.body.joints(betas)[0], (len(poses), 1))
        return torch.from_numpy(self.body.transforms(poses, home, betas)).float()

    def features(
        self,
        motion: Motion,
        recipe: Recipe,
        betas: np.ndarray | None = None,
        *,
        kind: str = "motion",
        still: bool = False,
    ) -> Tensor:
        """Inputs of a network, (T, D) float32: the pose; for `motion` the root velocity and the shape too,
        for `pose_shape` the shape, with zeros behind it up to SHAPES numbers, for `history` how root and
        joints move and moved (snug.networks.inputs).

        still: as if each pose were held, whatever came before it.
        """
        if kind not in FEATURE_SETS:
            raise ValueError(f"unknown features {kind!r}: use one of {tuple(FEATURE_SETS)}")
        rotations = rotation_matrices(motion.poses)
        parts = [_pose_numbers(motion.poses, rotations, recipe.pose_input)]
        if kind == "motion":
            velocity = _root_velocity(motion, rotations[:, 0], recipe.velocity_frame)
            parts.append(velocity * (not still))
        if kind == "history":
            parts.append(motion_history(motion) * (not still))
        if kind in ("motion", "pose_shape"):
            shape = np.zeros(self.body.shape_count) if betas is None else np.asarray(betas)
            if kind == "pose_shape":
                shape = np.pad(shape, (0, SHAPES - len(shape)))
            parts.append(np.broadcast_to(shape, (len(motion.poses), len(shape))))
        return torch.from_numpy(np.concatenate(parts, axis=1).astype(np.float32))

    def skinned(
        self,
        motion: Motion,
        betas: np.ndarray | None = None,
        *,
        smoothing: int = 0,
        offsets: Tensor | None = None,
    ) -> np.ndarray:
        """World vertices (T, V, 3) [m] float64 of the unposed garment plus offsets (T, V, 3), skinned."""
        unposed = self.rest(betas) if offsets is None else self.rest(betas) + offsets
        posed = skin(unposed, self.weights(smoothing), self.transforms(motion.poses, betas))
        return posed.double().numpy() + self.pelvis(motion, betas)[:, None]


def _pose_numbers(poses: np.ndarray, rotations: np.ndarray, pose_input: str) -> np.ndarray:
    """(T, 72) axis-angle numbers, or (T, 141): up direction in the root's axes and 6 numbers a joint.

    Those are the first two columns of its rotation (Zhou et al. 2019, "On the continuity of rotation
    representations in neural networks").
    """
    if pose_input == "axis_angle":
        return poses.reshape(len(poses), -1)
    up = rotations[:, 0, 1, :]  # R^T e_y: a walk to the east and a walk to the north give the same input
    columns = rotations[:, 1:, :, :2].swapaxes(-1, -2)
    return np.concatenate([up, columns.reshape(len(poses), -1)], axis=1)


def _root_velocity(motion: Motion, root: np.ndarray, frame: str) -> np.ndarray:
    """Velocity of the root joint, (T, 3) [m/s]; zero in the first frame, which has no past."""
    velocity = np.diff(motion.translations, axis=0, prepend=motion.translations[:1]) * motion.fps
    return velocity if frame == "world" else np.einsum("tji,tj->ti", root, velocity)
