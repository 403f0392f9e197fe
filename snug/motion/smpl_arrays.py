"""Read motions of SMPL's joints from arrays: .npz in AMASS's layout and others by their keys, .npy, .pkl.

Axis-angle, rotation matrices or unit quaternions, relative to the parent joint. SMPL, SMPL+H and SMPL-X
begin with the same 22 joints. Only SMPL's own two hand joints are the ones of our tree; the others carry
fingers there, which a garment never meets. Shape coefficients and soft tissue are left out: shape is the
caller's choice.

| content | arrays, the first that is there | shape, T frames |
| --- | --- | --- |
| axis-angle [rad] | `poses`, `pose` | SMPL (T, 72), (T, 24, 3), SMPL+H (T, 156), SMPL-X (T, 165), (T, 66) |
| the same, root apart | `poses`, `pose`, `pose_body`, `body_pose` | (T, 63), (T, 69) |
| root apart | `root_orient`, `global_orient` | (T, 3), (T, 1, 3), (T, 3, 3), (T, 1, 3, 3) |
| matrices | `rotations`, `rotation_matrices`, or any above | (T, joints, 3, 3) |
| quaternions, w first | `quaternions`, `rotations_quat`, `quaternions_wxyz` | (T, joints, 4) |
| quaternions, w last | `quaternions_xyzw` | (T, joints, 4) |
| path of the root [m] | `trans`, `transl`, `translations` | (T, 3), (T, 1, 3) |
| rate [1/s] | `mocap_framerate`, `mocap_frame_rate`, `framerate`, `frame_rate`, `fps` | one number |
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from reference_sim.files.array_file import ArrayFileError, array_names, read_array, read_arrays
from snug.body.plain_pickle import PlainPickleError, read_plain_pickle
from snug.body.skeleton import BODY_JOINTS, JOINT_NAMES, axis_angles
from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions
from snug.motion.raw_motion import RawMotion, check_frame_count, frame_rate

LAYOUTS = {22: "body", 24: "SMPL", 52: "SMPL+H", 55: "SMPL-X"}  # joints, the root among them
# Of several names the first that a file has is read.
QUATERNIONS = {  # name: where w stands
    "quaternions": 0, "rotations_quat": 0, "quaternions_wxyz": 0, "quaternions_xyzw": 3,
}  # fmt: skip
ROTATIONS = ("poses", "pose", "rotations", "rotation_matrices", *QUATERNIONS)
BODY_ROTATIONS = ("pose_body", "body_pose")
ROOT_ROTATIONS = ("root_orient", "global_orient")
PATHS = ("trans", "transl", "translations")
RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
ARRAY_NAMES = (*ROTATIONS, *BODY_ROTATIONS, *ROOT_ROTATIONS, *PATHS, *RATES)
PLAIN = (np.ndarray, int, float, list, tuple)
UNIT = 0.02  # a quaternion's length, and a matrix's entries, may be off by as much


def read_npz(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read an .npz with rotations, a path of the root [m] and a frame rate [1/s]. Raises MotionError."""
    try:
        arrays = read_arrays(path, ARRAY_NAMES)
        if not arrays:
            names = ", ".join(array_names(path)[:12]) or "nothing"
            raise MotionError(f"{path}: no array of a motion (found {names}); give 'poses', 'trans', 'fps'")
    except ArrayFileError as error:
        raise MotionError(f"{error}; give an .npz motion file, export or download it again") from None
    return make_raw_motion(path, arrays, options)


def read_npy(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read an .npy with rotations alone; the root stays in place. Raises MotionError."""
    try:
        poses = read_array(path)
    except ArrayFileError as error:
        raise MotionError(f"{error}; give an .npy of plain numbers, or an .npz motion file") from None
    in_place = np.zeros((len(np.atleast_1d(poses)), 3))
    return make_raw_motion(path, {"poses": poses, "trans": in_place}, options, "; no path: the root stays")


def read_pkl(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read a pickled dict with the arrays of an .npz. Nothing in it is executed. Raises MotionError."""
    try:
        content = read_plain_pickle(path)
    except PlainPickleError as error:
        raise MotionError(str(error)) from None
    if not isinstance(content, dict):
        raise MotionError(f"{path}: holds no dict of arrays; write an .npz motion file")
    given = {name: content[name] for name in ARRAY_NAMES if isinstance(content.get(name), PLAIN)}
    try:
        arrays = {name: np.asarray(values) for name, values in given.items()}
    except ValueError:
        raise MotionError(f"{path}: a list of rows of several lengths; give arrays, a row a frame") from None
    if not arrays:
        names = ", ".join(map(str, list(content)[:12]))[:200] or "nothing"
        raise MotionError(f"{path}: no array of a motion (found {names}); give 'poses', 'trans', 'fps'")
    return make_raw_motion(path, arrays, options)


def make_raw_motion(
    path: Path, arrays: dict[str, np.ndarray], options: MotionFileOptions, note: str = ""
) -> RawMotion:
    """Make a motion of arrays by the names that docs/bring-your-own.md lists. Raises MotionError."""
    arrays = {name: _numbers(path, name, array) for name, array in arrays.items()}
    turns, what = _rotations(path, arrays)
    check_frame_count(path, len(turns))
    name = _first(arrays, PATHS)
    if name is None:
        raise MotionError(f"{path}: no array 'trans', the root's path (frames, 3) [m]; zeros where it stays")
    translations = arrays[name]
    if translations.shape not in ((len(turns), 3), (len(turns), 1, 3)):
        raise MotionError(
            f"{path}: '{name}' has shape {translations.shape}; give ({len(turns)}, 3), a row for each pose"
        )
    poses = np.zeros((len(turns), len(JOINT_NAMES), 3))
    kept = poses.shape[1] if turns.shape[1] == poses.shape[1] else BODY_JOINTS
    poses[:, :kept] = turns[:, :kept]
    fps = frame_rate(path, _stated_rate(path, arrays), options)
    source = f"{path.name} ({what}, {LAYOUTS[turns.shape[1]]} layout{note})"
    return RawMotion(path=path, poses=poses, translations=translations.reshape(-1, 3), fps=fps, source=source)


def _numbers(path: Path, name: str, array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "iuf":
        raise MotionError(f"{path}: array '{name}' does not hold numbers; give floating-point values")
    return array.astype(np.float64)


def _first(arrays: dict[str, np.ndarray], names: tuple[str, ...]) -> str | None:
    return next((name for name in names if name in arrays), None)


def _stated_rate(path: Path, arrays: dict[str, np.ndarray]) -> float | None:
    name = _first(arrays, RATES)
    if name is None:
        return None
    fps = arrays[name]
    if fps.size != 1 or not 0 < fps.item() < np.inf:
        raise MotionError(f"{path}: '{name}' is no positive number; give one number of frames per second")
    return float(fps.item())


def _rotations(path: Path, arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, str]:
    """Return rotations (T, J, 3) [rad] of the root and the others, J one of LAYOUTS, and their array's name.

    Raises MotionError.
    """
    name = _first(arrays, (*ROTATIONS, *BODY_ROTATIONS))
    if name is None:
        names = ", ".join(sorted(arrays))
        raise MotionError(f"{path}: no array of rotations (found {names}); give 'poses' (frames, 72)")
    turns = _axis_angles(path, name, arrays[name])
    if turns.shape[1] + 1 in LAYOUTS:
        root = _first(arrays, ROOT_ROTATIONS)
        if root is None:
            raise MotionError(f"{path}: no array '{ROOT_ROTATIONS[0]}', the root's rotation, beside '{name}'")
        matrices = arrays[root].shape[1:] == (3, 3)
        first = _axis_angles(path, root, arrays[root][:, None] if matrices else arrays[root])
        if first.shape != (len(turns), 1, 3):
            raise MotionError(
                f"{path}: '{root}' has shape {arrays[root].shape}; give one rotation for each of the "
                f"{len(turns)} frames of '{name}'"
            )
        turns, name = np.concatenate([first, turns], axis=1), f"{root} and {name}"
    if turns.shape[1] not in LAYOUTS:
        known = ", ".join(f"{3 * joints} ({layout})" for joints, layout in LAYOUTS.items())
        raise MotionError(
            f"{path}: '{name}' has shape {arrays[name].shape}; give (frames, columns), columns one of {known}"
        )
    return turns, name


def _axis_angles(path: Path, name: str, array: np.ndarray) -> np.ndarray:
    """Return (T, J, 3) [rad] of axis-angles (T, 3 J) or (T, J, 3), matrices, or quaternions (T, J, 4)."""
    shape = array.shape
    if array.size == 0:
        raise MotionError(f"{path}: '{name}' has shape {shape} and no frame; give a clip with frames")
    if name in QUATERNIONS:
        if array.ndim == 3 and shape[2] == 4:
            return _from_quaternions(path, name, array)
        raise MotionError(f"{path}: '{name}' has shape {shape}; give (frames, joints, 4)")
    if array.ndim == 4 and shape[2:] == (3, 3):
        return _from_matrices(path, name, array)
    if (array.ndim == 3 and shape[2] == 3) or (array.ndim == 2 and shape[1] % 3 == 0):
        return array.reshape(len(array), -1, 3)
    raise MotionError(
        f"{path}: '{name}' has shape {shape}; give (frames, 3 joints), (frames, joints, 3) [rad] or rotation "
        "matrices (frames, joints, 3, 3)"
    )


def _from_matrices(path: Path, name: str, matrices: np.ndarray) -> np.ndarray:
    whole = np.isfinite(matrices).all(axis=(2, 3))
    matrices = np.where(whole[..., None, None], matrices, np.eye(3))
    off = np.abs(np.swapaxes(matrices, -1, -2) @ matrices - np.eye(3)).max(axis=(2, 3))
    _check_entries(path, name, (off > UNIT) | (np.linalg.det(matrices) <= 0), "is no rotation matrix")
    return np.where(whole[..., None], axis_angles(matrices), np.nan)


def _from_quaternions(path: Path, name: str, quaternions: np.ndarray) -> np.ndarray:
    w = QUATERNIONS[name]
    whole = np.isfinite(quaternions).all(axis=2)
    quaternions = np.where(whole[..., None], quaternions, np.eye(4)[w])
    _check_entries(
        path, name, np.abs(np.linalg.norm(quaternions, axis=2) - 1.0) > UNIT, "is no unit quaternion"
    )
    # Most joints turn by less than 90 degrees most of the time: w is then the largest of the four.
    if (np.abs(quaternions).argmax(axis=2) == 3 - w).mean() > 0.5:
        order = "quaternions_xyzw" if w == 0 else "quaternions_wxyz"
        raise MotionError(f"{path}: '{name}' has w at the other end; name the array '{order}'")
    ordered = quaternions if w == 3 else quaternions[..., [1, 2, 3, 0]]
    turns = Rotation.from_quat(ordered.reshape(-1, 4)).as_rotvec().reshape(*whole.shape, 3)
    return np.where(whole[..., None], turns, np.nan)


def _check_entries(path: Path, name: str, wrong: np.ndarray, problem: str) -> None:
    for frame, joint in np.argwhere(wrong)[:1]:
        raise MotionError(
            f"{path}: '{name}' of frame {frame}, joint {joint} {problem}; give rotations relative to "
            "the parent"
        )
