"""Read a body of SMPL's family: .npz of plain arrays, or .pkl as the models are distributed.

| content | arrays, the first that is there | shape |
| --- | --- | --- |
| vertices | `v_template`, `vertices`, `template` | (B, 3) [m], y up, facing +z, pelvis at x = 0 |
| faces, closed and wound outwards | `f`, `faces` | (F, 3) |
| weights, rows sum to one | `weights`, `blend_weights`, `lbs_weights`, `skinning_weights` | (B, J) |
| SMPL's tree | `kintree_table`; or `parents` | (2, J); (J,) |
| joints from vertices, dense or `csc_matrix` | `J_regressor` | (J, B) |
| or joints, of a body without shapes | `J_template`, `joints`, `joint_template`, `J` | (J, 3) [m] |
| shapes, optional, the first ten | `shapedirs`, `shape_directions` | (B, 3, S) |
| pose correctives, optional | `posedirs` | (B, 3, 9 (J - 1)) |

J: 24 of SMPL, 52 of SMPL-H, 55 of SMPL-X. Of the latter two, fingers go into the hand, jaw and eyes into
the head, in weights and skeleton; the hand's joint is the mean of its knuckles. Arms are horizontal and
legs vertical, since motions are relative to the T pose.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.files.array_file import ArrayFileError, read_arrays, read_pickled_arrays
from reference_sim.geometry.topology import boundary_loops, check_closed
from snug.body.parametric_body import SHAPES, Body
from snug.body.skeleton import BODY_JOINTS, JOINT, JOINT_NAMES, PARENTS, BodyError

JOINTS = len(JOINT_NAMES)
FOLDED = {20: JOINT["left_hand"], 21: JOINT["right_hand"], 15: 15}  # what hangs on wrists and head
MAX_HOLE = 0.15  # [m] around: an eye of SMPL-X is closed, a missing foot is not
# Limb, first and last joint: largest angle to the axis x, or to the vertical [degrees].
LIMITS = {("arm", "shoulder", "wrist"): 10.0, ("leg", "hip", "ankle"): 8.0}

SYNONYMS = {
    "v_template": ("v_template", "vertices", "template"),
    "f": ("f", "faces"),
    "weights": ("weights", "blend_weights", "lbs_weights", "skinning_weights"),
    "kintree_table": ("kintree_table", "parents"),
    "J_regressor": ("J_regressor",),
    "J_template": ("J_template", "joints", "joint_template", "J"),
    "shapedirs": ("shapedirs", "shape_directions"),
    "posedirs": ("posedirs",),
}
REQUIRED = ("v_template", "f", "weights", "kintree_table")

Arrays = dict[str, np.ndarray]


def read_body(path: str | Path | None) -> Body:
    """Read and check a user's body, an .npz or .pkl of the table above; None is the body of the package.

    Raises:
        BodyError: file, array, remedy.

    >>> read_body(None).shape_count
    10
    """
    if path is None:
        return Body.load()
    path = Path(path)
    try:
        return _make_body(_read_arrays(path))
    except ArrayFileError as error:
        remedy = "expected an .npz of plain arrays, as numpy.savez writes, or a .pkl"
        raise BodyError(f"{error}; {remedy}") from error
    except BodyError as error:
        raise BodyError(f"{path}: {error}") from error


def _read_arrays(path: Path) -> Arrays:
    """Return the arrays of a body by the first of their synonyms."""
    names = [name for synonyms in SYNONYMS.values() for name in synonyms]
    read = read_pickled_arrays if path.suffix.lower() in (".pkl", ".pickle") else read_arrays
    content = read(path, names)
    arrays = {}
    for key, synonyms in SYNONYMS.items():
        if hits := [content[name] for name in synonyms if name in content]:
            arrays[key] = hits[0]
    if gaps := [" or ".join(SYNONYMS[key]) for key in REQUIRED if key not in arrays]:
        raise BodyError(f"no array {', '.join(gaps)}; expected SMPL's layout")
    return arrays


def _numbers(arrays: Arrays, key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return an array of that shape (None: any length) as float64. Raises BodyError."""
    array = arrays[key]
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape))
    if not fits or array.dtype.kind not in "fiu" or 0 in array.shape:
        layout = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise BodyError(f"{key} is {array.dtype} {array.shape}; expected numbers of shape {layout}")
    array = array.astype(np.float64)
    if bad := np.count_nonzero(~np.isfinite(array)):
        raise BodyError(f"{key} has {bad} values that are not finite")
    return array


def _make_body(arrays: Arrays) -> Body:
    """Make the body. Raises BodyError."""
    template = _numbers(arrays, "v_template", (None, 3))
    count = len(template)
    weights, places, folded = _skeleton(arrays, count)
    directions = np.zeros((count, 3, 0))
    if "shapedirs" in arrays:
        directions = _numbers(arrays, "shapedirs", (count, 3, None))[:, :, :SHAPES]
    joints, joint_directions = _joints(arrays, template, directions, len(folded))
    correctives = None
    if "posedirs" in arrays:  # folded fingers, jaw and eyes stay straight and need none
        width = 9 * ((JOINTS if len(folded) == JOINTS else BODY_JOINTS) - 1)
        correctives = _numbers(arrays, "posedirs", (count, 3, 9 * (len(folded) - 1)))[:, :, :width].copy()
    body = Body(
        template=template,
        shape_directions=directions,
        skinning_weights=weights @ folded,
        joint_template=places @ joints,
        joint_directions=np.einsum("ij,jas->ias", places, joint_directions),
        faces=_faces(arrays, template),
        parents=np.array(PARENTS),
        pose_directions=correctives,
    )
    _check_place(template, body.joint_template)
    return body


def _skeleton(arrays: Arrays, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return weights (B, J), rows summing to one, and two matrices that make 24 joints of J.

    The first, (24, J), averages positions of joints; the second, (J, 24), adds up weights.
    """
    table = arrays["kintree_table"]
    parents = table[0] if table.ndim == 2 and table.size else table
    layouts = "kintree_table (2, J) or parents (J,) of J = 24 (SMPL), 52 (SMPL-H) or 55 (SMPL-X) joints"
    if parents.ndim != 1 or len(parents) not in (24, 52, 55) or table.dtype.kind not in "iuf":
        raise BodyError(f"the tree of joints is {table.dtype} {table.shape}; expected {layouts}")
    joints = len(parents)
    weights = _numbers(arrays, "weights", (count, joints))
    sums = weights.sum(axis=1, keepdims=True)
    if weights.min() < -1e-6 or np.abs(sums - 1.0).max() > 1e-3:
        raise BodyError("weights must be non-negative with rows that sum to one")
    for joint in range(1, joints):
        hosts = (PARENTS[joint],) if joint < BODY_JOINTS else (*FOLDED, *range(BODY_JOINTS, joint))
        if parents[joint] not in hosts:
            raise BodyError(f"the tree of joints is not SMPL's: joint {joint} hangs on {parents[joint]}")
    places, folded = np.eye(JOINTS, joints), np.eye(joints, JOINTS)
    places[BODY_JOINTS:], folded[BODY_JOINTS:] = 0.0, 0.0
    for joint in range(BODY_JOINTS, joints):
        if (parent := int(parents[joint])) in FOLDED:
            folded[joint, FOLDED[parent]] = 1.0
            # Knuckles; the head stays where it is.
            places[FOLDED[parent], joint] = parent != FOLDED[parent]
        else:
            folded[joint] = folded[parent]
    knuckles = places.sum(axis=1, keepdims=True)
    if knuckles.min() == 0:
        raise BodyError("the tree of joints has a wrist without a finger")
    return weights / sums, places / knuckles, folded


def _joints(
    arrays: Arrays, template: np.ndarray, directions: np.ndarray, joints: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the joints (J, 3) and what a unit of each shape coefficient adds to them (J, 3, S)."""
    if "J_regressor" in arrays:
        regressor = _numbers(arrays, "J_regressor", (joints, len(template)))
        return regressor @ template, np.einsum("jv,vcs->jcs", regressor, directions)
    if "J_template" not in arrays or directions.shape[2]:
        raise BodyError("no joints; expected J_regressor, or joints of a body without shapes")
    return _numbers(arrays, "J_template", (joints, 3)), np.zeros((joints, 3, 0))


def _check_place(template: np.ndarray, joints: np.ndarray) -> None:
    """Raise BodyError unless this is a person in metres, y up, facing +z, at x = 0, in T pose."""
    low, high = template.min(axis=0), template.max(axis=0)
    size = high - low
    if not 0.5 < size[1] < 3.0 or max(size) > 3.0:
        raise BodyError(
            f"v_template is {size[1]:.3g} high along y, {size[0]:.3g} wide and {size[2]:.3g} deep; "
            "expected a standing body in metres, y up"
        )
    strays = np.flatnonzero((joints < low - 0.02).any(axis=1) | (joints > high + 0.02).any(axis=1))
    if len(strays):
        place = ", ".join(f"{x:.3g}" for x in joints[strays[0]])
        raise BodyError(
            f"joint {JOINT_NAMES[strays[0]]} at ({place}) is outside of the body; "
            "give joints in metres and in SMPL's order"
        )
    at = {name: joints[JOINT[name]] for name in JOINT}
    if at["left_shoulder"][0] < at["right_shoulder"][0] + 0.05 or at["neck"][1] < at["pelvis"][1] + 0.05:
        raise BodyError("the left shoulder is not at larger x, or the neck not above; turn it to face +z")
    if abs(at["pelvis"][0]) > 0.05:
        raise BodyError(f"the pelvis is {at['pelvis'][0]:.3g} m beside x = 0; shift the body")
    for (side, out), (limb, start, end) in product((("left", 1), ("right", -1)), LIMITS):
        bone = at[f"{side}_{end}"] - at[f"{side}_{start}"]
        straight = out * bone[0] if limb == "arm" else -bone[1]
        angle = np.degrees(np.arccos(straight / max(np.linalg.norm(bone), 1e-9)))
        if not angle <= LIMITS[limb, start, end]:
            raise BodyError(
                f"the {side} {limb} is {angle:.0f} degrees off the T pose; pose it so at rest"
            )


def _faces(arrays: Arrays, template: np.ndarray) -> np.ndarray:
    """Return the triangles (F, 3) of a closed surface, wound outward.

    Small holes, as the eyes of SMPL-X, are closed by fans of triangles. Raises BodyError.
    """
    faces = arrays["f"]
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu" or faces.size == 0:
        raise BodyError(f"f is {faces.dtype} {faces.shape}; expected vertex indices of shape (any, 3)")
    faces = faces.astype(np.int64)
    if (wrong := faces[(faces < 0) | (faces >= len(template))]).size:
        raise BodyError(f"f names vertex {wrong[0]}; the body has {len(template)}")
    try:
        for loop in boundary_loops(faces):
            around = np.linalg.norm(template[loop] - template[np.roll(loop, 1)], axis=1).sum()
            if around > MAX_HOLE:
                raise MeshError(f"a hole at vertex {loop[0]} is {around:.2g} m around")
            fan = np.stack([np.full(len(loop) - 2, loop[0]), loop[2:], loop[1:-1]], axis=1)
            faces = np.concatenate([faces, fan])
        check_closed(template[None], faces)
    except ValueError as error:
        raise BodyError(f"f is no closed surface: {str(error).removeprefix('obstacle ')}") from error
    return faces
