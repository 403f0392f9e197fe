"""Roll-outs of other programs: positions over time from the files that the field writes.

| file | content |
| --- | --- |
| `.npz` | `positions`; optional `faces`, `fps`, `quasi_static`, `obstacle`, `obstacle_faces` |
| `.vtkhdf`, `.hdf` | a trajectory of this project |
| `.pkl` | `pred`, `cloth_faces`, `obstacle`, `obstacle_faces`, as HOOD and ContourCraft write them |
| `.pc2`, `.pc16` | point cache, as Neural Cloth Simulation writes it; faces of the `.obj` of the same name |
| folder, pattern | one mesh a frame (`.obj`, `.ply` and others), by their evenly spaced numbers |

Nothing is executed. What does not fit the scene (unit, axes, order, rate, place) is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from benchmarks.results.run_folder import NOT_TAKEN, flat
from reference_sim.files.array_file import read_arrays, read_pickled_arrays
from reference_sim.files.mesh_files import MESH_SUFFIXES, read_mesh, read_sequence, to_metres_y_up
from snug.file_options import split_words

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene

CHARACTERS = r"\w+.-"  # of a name, as a class of a regular expression
MODULE = "benchmarks.methods.outside:make_stored"
PLACE = "{scene}"  # in a path: the scene's name, its slashes as hyphens
# Share of the cloth's diagonal: farthest that a first frame lies from the scene's.
FIRST = 0.15
# Share of the cloth's diagonal: farthest that its centre lies from where the body is.
FARTHEST = 0.25
RATE_TOLERANCE = 1e-4  # of a frame rate: people write it with some digits


class RollOutFileError(ValueError):
    """A roll-out is unreadable or not of the scene; the message has file and remedy."""


@dataclass(frozen=True)
class RollOutOption:
    """One roll-out, and what its file does not state itself."""

    name: str  # of the method
    path: str  # of a file, a folder or a pattern, with PLACE
    units: Literal["m", "cm", "mm", "in"] = "m"
    up: Literal["y", "z"] = "y"
    fps: float | None = None  # they have to be the scene's
    other_mesh: bool = False  # whether its vertices are those of another mesh of the same garment
    ms: float | None = None  # declared time of a frame
    role: str = "external"  # of the method

    def __post_init__(self) -> None:
        for field, number in (("fps", self.fps), ("ms", self.ms)):
            if number is not None and not 0.0 < number < 1e9:
                raise RollOutFileError(f"{field}={number}: give a positive number")
        if not re.fullmatch(rf"{NOT_TAKEN}\w[{CHARACTERS}]*", self.name):
            raise RollOutFileError(
                f"{self.path}: the name '{self.name}' has other than letters, digits and _-+., begins "
                "with one of -+., is 'body' or ends in 'quasi-static': give another, as mine=FILE"
            )

    def path_for(self, scene: str) -> str:
        """Return the path of the roll-out in a scene."""
        return self.path.replace(PLACE, flat(scene))


def parse_roll_out(text: str, *, named: bool = True) -> tuple[str, dict[str, Any]]:
    """Parse NAME=FILE[,key=value...] into name and table; without `named`, NAME= may be absent.

    Raises:
        RollOutFileError: there is no name or no file.

    >>> parse_roll_out("mine=out.npz,units=cm,ms=2.2")
    ('mine', {'path': 'out.npz', 'units': 'cm', 'ms': 2.2})
    """
    locator, options = split_words(text)
    name, equals, path = (part.strip() for part in locator.partition("="))
    if not (named or equals):
        stem = Path(locator.rstrip("/").replace(PLACE, "")).stem
        name, path = re.sub(rf"[^{CHARACTERS}]+", "-", stem).strip("_-+.") or "roll-out", locator
    if not (name and path):
        raise RollOutFileError(f"{text}: give NAME=FILE, with ,units=cm and the like behind it")
    return name, {"path": path, **options}


OVER_TIME = ("positions", "obstacle", "quasi_static")
FACES = {"faces": "positions", "obstacle_faces": "obstacle"}  # of which vertices
KEYS = {"pred": "positions", "cloth_faces": "faces"}  # of an npz, and of a pickle
KEYS |= {name: name for name in (*OVER_TIME, *FACES, "fps")}


@dataclass(frozen=True, eq=False)
class StoredRollOut:
    """Contents of a file, in its unit, axes and order; positions need not be finite.

    None: the file does not say.
    """

    positions: np.ndarray  # (T,V,3)
    dtype: str = "float64"  # of the numbers in the file
    faces: np.ndarray | None = None  # (F,3)
    fps: float | None = None
    obstacle: np.ndarray | None = None  # (T,B,3)
    obstacle_faces: np.ndarray | None = None  # (G,3)
    quasi_static: np.ndarray | None = None  # (T,V,3), the answer to each pose held still
    converged: np.ndarray | None = None  # (T,) whether each frame claims to be


def read_roll_out(path: str | Path) -> StoredRollOut:
    """Read a file, a folder or a pattern of files. Raises RollOutFileError."""
    path = str(path)
    suffix = Path(path).suffix.lower()
    suffixes = (*_READERS, *MESH_SUFFIXES)
    if suffix not in suffixes and not (Path(path).is_dir() or "*" in path):
        raise RollOutFileError(f"{path}: unknown kind: give one of {', '.join(suffixes)}, or a folder")
    try:
        return _check(_READERS.get(suffix, _meshes)(path))
    except Exception as error:  # a damaged file fails in nearly every way
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise RollOutFileError(reason if path in reason else f"{path}: {reason}") from None


def _check(arrays: Mapping[str, Any]) -> StoredRollOut:
    """Return the arrays, shapes compared. Raises ValueError, without the file's name."""
    arrays = {name: np.asarray(array) for name, array in arrays.items() if array is not None}
    if "positions" not in arrays:
        raise ValueError("holds no positions (T,V,3): name them 'positions' in npz, 'pred' in pickle")
    series = {name: _floats(name, arrays[name]) for name in OVER_TIME if name in arrays}
    shape = series["positions"].shape
    for name, array in series.items():
        if len(array) != len(series["positions"]) or (name == "quasi_static" and array.shape != shape):
            raise ValueError(f"{name} is {array.shape}, positions {shape}")
    for name, mesh in FACES.items():
        if name in arrays:
            count = series[mesh].shape[1] if mesh in series else np.inf
            series[name] = _triangles(name, arrays[name], count)
    fps = float(arrays["fps"].item()) if "fps" in arrays else None
    if fps is not None and not 0.0 < fps < 1e6:
        raise ValueError(f"states {fps} frames per second")
    dtype = str(arrays["positions"].dtype.newbyteorder("="))
    return StoredRollOut(dtype=dtype, fps=fps, converged=arrays.get("converged"), **series)


def _floats(name: str, array: np.ndarray) -> np.ndarray:
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu" or 0 in array.shape:
        raise ValueError(f"{name} is {array.dtype} {array.shape}: numbers of shape (frames, vertices, 3)")
    return np.ascontiguousarray(array, dtype=np.float64)


def _triangles(name: str, array: np.ndarray, vertices: float) -> np.ndarray:
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu" or not len(array):
        raise ValueError(f"{name} is {array.dtype} {array.shape}: whole numbers of shape (triangles, 3)")
    strays = array[(array < 0) | (array >= vertices)]
    if len(strays):
        raise ValueError(f"{name} names vertex {strays[0]} of {vertices}")
    return array.astype(np.int64)


def _arrays(path: str) -> dict[str, Any]:
    read = read_arrays if path.lower().endswith(".npz") else read_pickled_arrays
    return {KEYS[name]: array for name, array in read(path, KEYS).items()}


def _point_cache(path: str) -> dict[str, Any]:
    from reference_sim.trajectory import read_point_cache

    mesh = Path(path).with_suffix(".obj")
    positions = read_point_cache(path)
    return {"positions": positions, "faces": read_mesh(mesh).faces if mesh.is_file() else None}


def _meshes(path: str) -> dict[str, Any]:
    positions, surface = read_sequence(path)
    return {"positions": positions, "faces": surface.faces}


def _trajectory(path: str) -> dict[str, Any]:
    from reference_sim.trajectory import Trajectory

    trajectory = Trajectory.load(path)
    claims = trajectory.frame_fields.get("converged")
    return {
        "positions": trajectory.positions,
        "faces": trajectory.faces,
        "fps": 1.0 / trajectory.dt if trajectory.frames > 1 else None,
        "converged": None if claims is None else np.asarray(claims),
    }


_READERS: dict[str, Callable[[str], dict[str, Any]]] = {
    ".vtkhdf": _trajectory, ".hdf": _trajectory, ".npz": _arrays, ".pkl": _arrays, ".pickle": _arrays,
    ".pc2": _point_cache, ".pc16": _point_cache,
}  # fmt: skip


def fit_to_scene(
    stored: StoredRollOut, scene: BuiltScene, *, units: str = "m", up: str = "y", fps: float | None = None,
    other_mesh: bool = False,
) -> StoredRollOut:  # fmt: skip
    """Return the roll-out in metres, y up, once shown to belong to the scene.

    What its file does not state itself is given as in a RollOutOption.

    Raises:
        RollOutFileError: with the remedy, without the file's name.
    """
    (frames, count), cloth, rate = stored.positions.shape[:2], scene.cloth, 1.0 / scene.dt
    stated = fps or stored.fps or rate
    same = other_mesh or stored.faces is None or _are_same_faces(stored.faces, cloth.faces)
    demands = (
        (not other_mesh or stored.faces is not None,
            "has no triangles: add those of its own mesh (faces of an npz, .obj of a point cache)"),
        (other_mesh or count == cloth.vertex_count,
            f"has {count} vertices, the cloth of {scene.name} {cloth.vertex_count}: write one position for "
            "each vertex of the scene's mesh, of the same sizes; corners split at seams are one vertex; or "
            "give other-mesh, to have surfaces compared alone"),
        (same,
            "its triangles join other vertices than the scene's: write the vertices in the order of the "
            "scene's mesh (rest.obj of an export), or give other-mesh, to have surfaces compared alone"),
        (abs(stated - rate) <= RATE_TOLERANCE * rate, f"has {stated:g} frames a second, the scene {rate:g}: "
            "write one position for each of its frames"),
        (frames == scene.frames, f"has {frames} frames, the scene has {scene.frames} with its start"),
    )  # fmt: skip
    for fine, otherwise in demands:
        if not fine:
            raise RollOutFileError(otherwise)
    positions = to_metres_y_up(stored.positions, units=units, up=up)
    _check_place(positions, expected_positions(scene), ordered=not other_mesh)
    solutions = stored.quasi_static
    return replace(
        stored, positions=positions,
        quasi_static=None if solutions is None else to_metres_y_up(solutions, units=units, up=up),
    )  # fmt: skip


def _check_place(positions: np.ndarray, expected: np.ndarray, *, ordered: bool) -> None:
    """Raise RollOutFileError unless the cloth (T,V,3) [m] starts in place and goes its way.

    A roll-out that explodes in the end is a result: the way counts in most frames before one that is not
    finite. Of another mesh bounding boxes are compared.
    """
    first, size = positions[0], float(np.linalg.norm(np.ptp(expected[0], axis=0)))
    if not np.isfinite(first).all():
        raise RollOutFileError("its first frame, the scene's start, is not finite")
    if ordered:
        gap = float(np.median(np.linalg.norm(first - expected[0], axis=1)))
    else:
        gap = max(np.abs(end(first, axis=0) - end(expected[0], axis=0)).max() for end in (np.min, np.max))
    if not gap <= FIRST * size:
        width = float(np.linalg.norm(np.ptp(first, axis=0)))
        raise RollOutFileError(
            f"its first frame is {width:.3g} m across and lies {gap:.3g} m from the scene's cloth, which "
            f"is {size:.3g} m across: write metres, y up (or say units=cm, up=z), world coordinates, and the "
            "vertices in the order of the scene's mesh"
        )
    frames = min(len(positions), len(expected))
    finite = np.isfinite(positions[:frames]).all(axis=(1, 2))
    frames = frames if finite.all() else int(finite.argmin())
    with np.errstate(over="ignore", invalid="ignore"):
        offsets = np.linalg.norm(positions[:frames].mean(axis=1) - expected[:frames].mean(axis=1), axis=1)
    strays = np.flatnonzero(~(offsets <= FARTHEST * size))
    if 2 * len(strays) > frames:
        raise RollOutFileError(
            f"from frame {strays[0]} on its centre lies {offsets[strays[0]]:.2g} m from where the body "
            "carries it: another motion, another frame rate, or coordinates that are not the world's"
        )


def _are_same_faces(theirs: np.ndarray, ours: np.ndarray) -> bool:
    """Return whether triangles (F,3) join the same vertices, in any order and winding."""
    one, other = (np.unique(np.sort(faces, axis=1), axis=0) for faces in (theirs, ours))
    return theirs.shape == ours.shape and np.array_equal(one, other)


def expected_positions(scene: BuiltScene) -> np.ndarray:
    """Return the skinned garment (T,V,3) [m]; without a body the start, (1,V,3)."""
    return scene.start[None] if scene.skinned is None else scene.skinned
