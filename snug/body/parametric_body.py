"""Parametric human: template, shape directions, joints and skinning weights, in the layout of SMPL.

Rest pose: T-pose, y up, facing +z, left arm along +x, metres. The body of the package stands with its
soles on y = 0 and its pelvis above the origin, for every shape. A posed vertex is the skinned rest vertex
plus the translation: joint 0 is at joints(betas)[0] + translation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_sim.files.array_file import read_arrays
from snug.body.skeleton import BodyError, joint_transforms, rotation_matrices

BODY_FILE = Path(__file__).resolve().parent.parent / "data" / "body.npz"
# Shape coefficients kept when a file has more, and read by networks of pose and shape.
SHAPES = 10
_CHUNK = 64  # frames skinned in one matrix product, to bound memory


@dataclass(frozen=True, eq=False)
class Body:
    """Skinned parametric body. All arrays are float64 (indices int64) and are not to be written to.

    Attributes:
        template: (B, 3) [m], vertices of the unposed body of mean shape.
        shape_directions: (B, 3, S) [m], what one unit of each shape coefficient adds to the template.
        skinning_weights: (B, 24), rows sum to one.
        joint_template: (24, 3) [m], joints of the unposed body of mean shape.
        joint_directions: (24, 3, S) [m], what one unit of each shape coefficient adds to them.
        faces: (F, 3), wound outward.
        parents: (24,), -1 for the root.
        pose_directions: None, or (B, 3, 9 K) [m]: pose correctives, for one unit of each entry of R - I,
            row by row, of the rotations R of joints 1 to K relative to their parents.

    Source:
        M. Loper et al., SMPL: a skinned multi-person linear model, ACM Transactions on Graphics 34
        (2015), equation 9 for the pose correctives.
    """

    template: NDArray[np.float64]
    shape_directions: NDArray[np.float64]
    skinning_weights: NDArray[np.float64]
    joint_template: NDArray[np.float64]
    joint_directions: NDArray[np.float64]
    faces: NDArray[np.int64]
    parents: NDArray[np.int64]
    pose_directions: NDArray[np.float64] | None = None

    @staticmethod
    def load() -> "Body":
        """Load the body that comes with this package.

        >>> round(Body.load().height, 2)  # [m]
        1.69
        """
        arrays: dict[str, Any] = {
            key: stored.astype(np.float64 if stored.dtype.kind == "f" else np.int64)
            for key, stored in read_arrays(BODY_FILE).items()
        }
        # float32 in the file: make the rows sum to one again in float64.
        arrays["skinning_weights"] /= arrays["skinning_weights"].sum(axis=1, keepdims=True)
        return Body(**arrays)

    def __repr__(self) -> str:
        return f"Body({len(self.template)} vertices, {self.shape_count} shape coefficients)"

    @property
    def shape_count(self) -> int:
        """Number S of shape coefficients."""
        return self.shape_directions.shape[-1]

    def rest_vertices(self, betas: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the vertices (B, 3) [m] of the unposed body of shape `betas` (S,), by default the mean.

        Raises:
            BodyError: another number of coefficients, or one that is not finite.
        """
        if betas is None:
            return self.template.copy()
        return self.template + self.shape_directions @ self._check(betas)

    def joints(self, betas: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the joints (24, 3) [m] of the unposed body of shape `betas` (S,). Raises BodyError."""
        if betas is None:
            return self.joint_template.copy()
        return self.joint_template + self.joint_directions @ self._check(betas)

    def vertices(
        self, poses: ArrayLike, translations: ArrayLike, betas: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the vertices (T, B, 3) [m] of the body of shape `betas` (S,) in poses (T, 24, 3) [rad].

        The translations (T, 3) [m] are added to the skinned vertices.

        Raises:
            BodyError: another shape of an argument, or a number that is not finite.

        >>> import numpy as np
        >>> shift = np.array([[0.0, 0.0, 1.0]])
        >>> body = Body.load()
        >>> moved = body.vertices(np.zeros((1, 24, 3)), shift)
        >>> bool(np.allclose(moved[0], body.template + shift))
        True
        """
        return self.poser(betas)(poses, translations)

    def poser(
        self, betas: ArrayLike | None = None
    ) -> Callable[[ArrayLike, ArrayLike], NDArray[np.float64]]:
        """Return the function `vertices` of one shape, for callers that pose frame after frame.

        The shaped vertices are computed once, here. Raises BodyError.
        """
        from scipy.sparse import csr_array  # a body that is not posed needs none

        # sum_j w_ij T_j (p_i, 1) is one product: (w_ij p_ik) over (j, k), mostly zero, times T over (j,
        # k).
        points = np.concatenate([self.rest_vertices(betas), np.ones((len(self.template), 1))], axis=1)
        spread = csr_array(
            (self.skinning_weights[:, :, None] * points[:, None, :]).reshape(len(points), -1)
        )

        def pose(poses: ArrayLike, translations: ArrayLike) -> NDArray[np.float64]:
            transforms = self.transforms(poses, translations, betas)
            if self.pose_directions is not None:
                return self._pose_corrected(points[:, :3], np.asarray(poses, dtype=float), transforms)
            posed = np.empty((len(transforms), len(points), 3))
            for start in range(0, len(transforms), _CHUNK):
                part = transforms[start : start + _CHUNK]
                columns = part.transpose(1, 3, 0, 2).reshape(spread.shape[1], -1)
                vertices = (spread @ columns).reshape(len(points), -1, 3)
                posed[start : start + _CHUNK] = vertices.transpose(1, 0, 2)
            return posed

        return pose

    def _pose_corrected(
        self, shaped: NDArray[np.float64], poses: NDArray[np.float64], transforms: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return posed vertices (T, B, 3) [m] with the pose correctives of each frame."""
        assert self.pose_directions is not None
        count = self.pose_directions.shape[2]
        entries = (rotation_matrices(poses[:, 1 : 1 + count // 9]) - np.eye(3)).reshape(len(poses), -1)
        directions = self.pose_directions.reshape(-1, count)
        posed = np.empty((len(poses), *shaped.shape))
        for frame, moved in enumerate(transforms):
            rest = shaped + (directions @ entries[frame]).reshape(-1, 3)
            blended = (self.skinning_weights @ moved.reshape(len(moved), -1)).reshape(-1, 3, 4)
            posed[frame] = np.einsum("vab,vb->va", blended[..., :3], rest) + blended[..., 3]
        return posed

    def transforms(
        self, poses: ArrayLike, translations: ArrayLike, betas: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the rest-to-posed transforms of the joints (T, 24, 3, 4). Arguments: see `vertices`."""
        poses, translations = np.asarray(poses, dtype=float), np.asarray(translations, dtype=float)
        joints = len(self.joint_template)
        if poses.ndim != 3 or poses.shape[1:] != (joints, 3) or translations.shape != (len(poses), 3):
            raise BodyError(
                f"poses {poses.shape} and translations {translations.shape}: "
                f"expected (T, {joints}, 3) and (T, 3)"
            )
        if not (np.isfinite(poses).all() and np.isfinite(translations).all()):
            raise BodyError("poses or translations hold values that are not finite; check the motion")
        return joint_transforms(poses, translations, self.joints(betas), self.parents.tolist())

    @cached_property
    def height(self) -> float:
        """Height of the template [m]."""
        return float(np.ptp(self.template[:, 1]))

    def _check(self, betas: ArrayLike) -> NDArray[np.float64]:
        betas = np.asarray(betas, dtype=float)
        if betas.shape != (self.shape_count,) or not np.isfinite(betas).all():
            raise BodyError(f"betas of shape {betas.shape}: expected {self.shape_count} finite numbers")
        return betas
