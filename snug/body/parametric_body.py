"""A parametric human: a template, shape directions, joints and skinning weights, in the layout of SMPL.

Rest pose: T-pose, y up, facing +z, left arm along +x, metres. The baked body stands with its soles on y = 0
and its pelvis above the origin, for every shape, so a motion's translation is zero where it stands.
A posed vertex is the skinned rest vertex plus the translation: joint 0 is at joints(betas)[0] + translation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_sim.files.array_file import read_arrays
from snug.body.skeleton import JOINT_NAMES, BodyError, joint_transforms, rotation_matrices

BAKED = Path(__file__).resolve().parent.parent / "data" / "body.npz"
_CHUNK = 64  # frames skinned in one matrix product, to bound memory


@dataclass(frozen=True, eq=False)
class Body:
    """A skinned parametric body. All arrays are float64 (indices int64) and are not to be written to.

    template: (B, 3) [m]. shape_directions: (B, 3, S) [m], for one unit of each shape coefficient.
    skinning_weights: (B, 24), rows sum to one. joint_template: (24, 3) [m]. joint_directions: (24, 3, S) [m].
    faces: (F, 3), outward. parents: (24,), -1 for the root. joint_names: 24 names, the same for every body.
    pose_directions: None, or (B, 3, 9 K) [m]: pose correctives, for one unit of each entry of R - I, row by
    row, of the rotations R of joints 1 to K relative to their parents (SMPL, Loper et al. 2015, eq. 9).
    arms_lowered: None, or (2,) [rad] by which the left and the right arm hang down in its file.
    """

    template: NDArray[np.float64]
    shape_directions: NDArray[np.float64]
    skinning_weights: NDArray[np.float64]
    joint_template: NDArray[np.float64]
    joint_directions: NDArray[np.float64]
    faces: NDArray[np.int64]
    parents: NDArray[np.int64]
    pose_directions: NDArray[np.float64] | None = None
    arms_lowered: NDArray[np.float64] | None = None
    joint_names: ClassVar[tuple[str, ...]] = JOINT_NAMES

    @staticmethod
    def load() -> "Body":
        """The body that comes with this package."""
        arrays = {key: _widened(stored) for key, stored in read_arrays(BAKED).items()}
        # float32 in the file: make the rows sum to one again in float64.
        arrays["skinning_weights"] /= arrays["skinning_weights"].sum(axis=1, keepdims=True)
        return Body(**arrays)

    @staticmethod
    def from_file(path: str | Path) -> "Body":
        """A user's body: .npz or .pkl, see snug.body.smpl_files. Raises BodyError."""
        from snug.body.smpl_files import read_smpl

        return Body(**read_smpl(Path(path)))

    @property
    def shape_count(self) -> int:
        return self.shape_directions.shape[-1]

    def shaped(self, betas: ArrayLike | None = None) -> NDArray[np.float64]:
        """Vertices (B, 3) [m] of the unposed body with these shape coefficients. Raises BodyError."""
        if betas is None:
            return self.template.copy()
        return self.template + self.shape_directions @ self._checked(betas)

    def joints(self, betas: ArrayLike | None = None) -> NDArray[np.float64]:
        """Joints (24, 3) [m] of the unposed body with these shape coefficients. Raises BodyError."""
        if betas is None:
            return self.joint_template.copy()
        return self.joint_template + self.joint_directions @ self._checked(betas)

    def vertices(
        self, poses: ArrayLike, translations: ArrayLike, betas: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Posed vertices (T, B, 3) [m].

        poses: (T, 24, 3) [rad], axis-angle relative to the parent joint. translations: (T, 3) [m].
        betas: (S,). Raises BodyError.
        """
        return self.poser(betas)(poses, translations)

    def poser(self, betas: ArrayLike | None = None) -> Callable[[ArrayLike, ArrayLike], NDArray[np.float64]]:
        """`vertices` of that shape for any poses and translations; what shape alone decides is computed here,
        once: for whoever poses frame after frame. Raises BodyError.
        """
        from scipy.sparse import csr_array

        # sum_j w_ij T_j (p_i, 1) is one product: (w_ij p_ik) over (j, k), mostly zero, times T over (j, k).
        points = np.concatenate([self.shaped(betas), np.ones((len(self.template), 1))], axis=1)
        spread = csr_array((self.skinning_weights[:, :, None] * points[:, None, :]).reshape(len(points), -1))

        def pose(poses: ArrayLike, translations: ArrayLike) -> NDArray[np.float64]:
            transforms = self.transforms(poses, translations, betas)
            if self.pose_directions is not None:
                return self._corrected(points[:, :3], np.asarray(poses, dtype=float), transforms)
            posed = np.empty((len(transforms), len(points), 3))
            for start in range(0, len(transforms), _CHUNK):
                part = transforms[start : start + _CHUNK]
                columns = part.transpose(1, 3, 0, 2).reshape(spread.shape[1], -1)
                each = (spread @ columns).reshape(len(points), -1, 3)
                posed[start : start + _CHUNK] = each.transpose(1, 0, 2)
            return posed

        return pose

    def _corrected(
        self, shaped: NDArray[np.float64], poses: NDArray[np.float64], transforms: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Posed vertices (T, B, 3) [m] with pose correctives: those of a frame change what is skinned."""
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
        """Rest-to-posed transform of each joint, (T, 24, 3, 4). Arguments and errors as for `vertices`."""
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

    def _checked(self, betas: ArrayLike) -> NDArray[np.float64]:
        betas = np.asarray(betas, dtype=float)
        if betas.shape != (self.shape_count,) or not np.isfinite(betas).all():
            raise BodyError(f"betas of shape {betas.shape}: expected {self.shape_count} finite numbers")
        return betas


def _widened(array: np.ndarray) -> np.ndarray:
    return array.astype(np.float64 if array.dtype.kind == "f" else np.int64)
