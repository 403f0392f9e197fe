"""AMASS and SMPL-layout motion files (.npz): poses, trans, mocap_framerate, gender; z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reference_sim.array_file import ArrayFileError, read_arrays
from snug.motion import Motion, MotionError
from snug.skeleton import axis_angles, rotation_matrices

# Columns of `poses`: SMPL, SMPL+H and SMPL-X begin with the same 22 joints. Only SMPL's own two hand joints
# are the ones of our tree; the others carry fingers there, which a garment never meets.
_BODY_COLUMNS = 66
_LAYOUTS = {72: "SMPL", 156: "SMPL+H", 165: "SMPL-X"}
_RATE_NAMES = ("mocap_framerate", "mocap_frame_rate", "fps")
# (x, y, z) with z up -> (x, z, -y) with y up.
_Z_UP_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
HAND_DAMPING = 0.1


def read_amass(path: Path) -> Motion:
    """One .npz: poses (T, 72 | 156 | 165) [rad], trans (T, 3) [m], a frame rate -> Motion, y up.

    Shape coefficients and soft-tissue data are left out: shape is the caller's choice. Rotations of the
    hands are damped to a tenth, as the authors of SNUG did. Raises MotionError.
    """
    arrays = _load(path)
    for name in ("poses", "trans"):
        if name not in arrays:
            found = ", ".join(sorted(arrays)) or "nothing"
            raise MotionError(
                f"{path}: no array '{name}' (found {found}); give a motion file in AMASS layout"
            )
    rates = [name for name in _RATE_NAMES if name in arrays]
    if not rates:
        raise MotionError(f"{path}: no frame rate; add an array 'mocap_framerate' with frames per second")
    poses, trans = _numbers(path, arrays, "poses"), _numbers(path, arrays, "trans")
    fps = _numbers(path, arrays, rates[0])
    if poses.ndim != 2 or poses.shape[1] not in _LAYOUTS or len(poses) == 0:
        known = ", ".join(f"{columns} ({name})" for columns, name in _LAYOUTS.items())
        raise MotionError(
            f"{path}: 'poses' has shape {poses.shape}; give (frames, columns), columns one of {known}"
        )
    if trans.shape != (len(poses), 3):
        raise MotionError(f"{path}: 'trans' has shape {trans.shape}; give ({len(poses)}, 3) to match 'poses'")
    if fps.size != 1 or not fps.item() > 0:
        raise MotionError(f"{path}: '{rates[0]}' is {fps}; give one positive number of frames per second")
    joints = np.zeros((len(poses), 24, 3))
    joints[:, :22] = poses[:, :_BODY_COLUMNS].reshape(-1, 22, 3)
    if poses.shape[1] == 72:
        joints[:, 22:] = poses[:, _BODY_COLUMNS:].reshape(-1, 2, 3)
    joints[:, 20:] *= HAND_DAMPING
    joints[:, 0] = axis_angles(_Z_UP_TO_Y_UP @ rotation_matrices(joints[:, 0]))
    source = f"{path.name} ({_LAYOUTS[poses.shape[1]]} layout)"
    return Motion(path.stem, joints, trans @ _Z_UP_TO_Y_UP.T, fps.item(), "recorded", source)


def _load(path: Path) -> dict[str, np.ndarray]:
    try:
        return read_arrays(path, ("poses", "trans", *_RATE_NAMES))
    except ArrayFileError as error:
        raise MotionError(f"{error}; give an .npz motion file, export or download it again") from None


def _numbers(path: Path, arrays: dict[str, np.ndarray], name: str) -> np.ndarray:
    try:
        numbers = np.asarray(arrays[name], dtype=np.float64)
    except (TypeError, ValueError):
        raise MotionError(
            f"{path}: array '{name}' does not hold numbers; give floating-point values"
        ) from None
    if not np.isfinite(numbers).all():
        finite = np.isfinite(np.atleast_1d(numbers))
        first = int(np.argwhere(~finite)[0, 0])
        raise MotionError(f"{path}: array '{name}' is not finite in frame {first}; cut or repair that frame")
    return numbers
