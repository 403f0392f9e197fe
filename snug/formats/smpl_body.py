"""Read a body in SMPL's layout from an .npz file.

Arrays: v_template (B, 3) [m], shapedirs (B, 3, S), weights (B, 24), kintree_table (2, 24), f (F, 3), and
either J_regressor (24, B), or J_template (24, 3) with J_shapedirs (24, 3, S). Pose correctives (posedirs) are
not used: a body here is skinned linearly.
"""

from pathlib import Path

import numpy as np

from reference_sim.array_file import ArrayFileError, read_arrays
from snug.skeleton import JOINT_NAMES, BodyError

REQUIRED = ("v_template", "shapedirs", "weights", "kintree_table", "f")
SHAPES = 10  # coefficients kept when a file has more
JOINTS = len(JOINT_NAMES)


def read_smpl(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a `Body`, keyed by its field names. Raises BodyError: file, array, remedy."""
    stored = _stored_arrays(path)
    missing = [key for key in REQUIRED if key not in stored]
    if missing:
        raise BodyError(
            f"{path}: no array {', '.join(missing)}; expected SMPL's layout ({', '.join(REQUIRED)})"
        )
    template = _float(path, stored, "v_template", (None, 3))
    count = len(template)
    directions = _float(path, stored, "shapedirs", (count, 3, None))[:, :, :SHAPES]
    weights = _float(path, stored, "weights", (count, JOINTS))
    sums = weights.sum(axis=1, keepdims=True)
    if weights.min() < -1e-6 or np.abs(sums - 1.0).max() > 1e-3:
        raise BodyError(f"{path}: weights must be non-negative with rows that sum to one")
    joint_template, joint_directions = _joints(path, stored, template, directions)
    height = np.ptp(template[:, 1])
    if not 0.5 < height < 3.0:
        raise BodyError(
            f"{path}: v_template is {height:.3g} high along y; expected a standing body in metres, y up"
        )
    return {
        "template": template,
        "shape_directions": directions,
        "skinning_weights": weights / sums,
        "joint_template": joint_template,
        "joint_directions": joint_directions,
        "faces": _faces(path, stored, template),
        "parents": _parents(path, stored),
    }


def _stored_arrays(path: Path) -> dict[str, np.ndarray]:
    try:
        return read_arrays(path, (*REQUIRED, "J_regressor", "J_template", "J_shapedirs"))
    except ArrayFileError as error:
        raise BodyError(f"{error}; give an .npz of plain arrays, written with numpy.savez") from None


def _float(path: Path, stored: dict[str, np.ndarray], key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    array = stored[key]
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape))
    if not fits or array.dtype.kind not in "fiu" or array.size == 0:
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise BodyError(f"{path}: {key} is {array.dtype} {array.shape}; expected numbers of shape {wanted}")
    if not np.isfinite(array).all():
        raise BodyError(f"{path}: {key} holds values that are not finite")
    return array.astype(np.float64)


def _joints(
    path: Path, stored: dict[str, np.ndarray], template: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    if "J_regressor" in stored:
        regressor = _float(path, stored, "J_regressor", (JOINTS, len(template)))
        return regressor @ template, np.einsum("jv,vcs->jcs", regressor, directions)
    if "J_template" not in stored or "J_shapedirs" not in stored:
        raise BodyError(f"{path}: no joints; expected the array J_regressor, or J_template with J_shapedirs")
    moved = _float(path, stored, "J_shapedirs", (JOINTS, 3, None))[:, :, :SHAPES]
    if moved.shape[2] != directions.shape[2]:
        raise BodyError(f"{path}: J_shapedirs has {moved.shape[2]} shapes, shapedirs {directions.shape[2]}")
    return _float(path, stored, "J_template", (JOINTS, 3)), moved


def _parents(path: Path, stored: dict[str, np.ndarray]) -> np.ndarray:
    table = stored["kintree_table"]
    if table.shape != (2, JOINTS) or table.dtype.kind not in "iu":
        raise BodyError(f"{path}: kintree_table is {table.shape}; expected integers of shape (2, {JOINTS})")
    parents = table[0].astype(np.int64)
    parents[0] = -1  # SMPL writes 2^32 - 1 for the root
    if not all(0 <= parent < joint for joint, parent in enumerate(parents) if joint):
        raise BodyError(f"{path}: kintree_table: each joint's parent (first row) must come before the joint")
    return parents


def _faces(path: Path, stored: dict[str, np.ndarray], template: np.ndarray) -> np.ndarray:
    faces = stored["f"]
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu" or faces.size == 0:
        raise BodyError(
            f"{path}: f is {faces.dtype} {faces.shape}; expected vertex indices of shape (any, 3)"
        )
    faces = faces.astype(np.int64)
    if faces.min() < 0 or faces.max() >= len(template):
        raise BodyError(f"{path}: f names vertex {faces.max()}; the body has {len(template)}")
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = {(a, b) for a, b in edges.tolist()}
    if len(forward) != len(edges) or any((b, a) not in forward for a, b in forward):
        raise BodyError(f"{path}: f is not a closed surface with one winding; inside and outside need one")
    a, b, c = (template[faces[:, k]] for k in range(3))
    if np.einsum("ij,ij->", a, np.cross(b, c)) < 0:
        raise BodyError(f"{path}: f winds inwards; reverse the order of each triangle's vertices")
    return faces
