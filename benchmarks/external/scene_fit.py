"""Fit of a stored roll-out to a scene: unit, axes, order of vertices, frame rate and place are compared.

What does not fit is refused with the remedy and never guessed: a roll-out in centimetres would otherwise get
numbers, and nobody would see that they mean nothing.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.external.roll_out_files import FileConventions, RollOutFileError, StoredRollOut
from benchmarks.external.vertex_correspondence import nearest_order, same_faces, same_topology
from reference_sim.files.mesh_files import METRES, UP_AXES, to_metres_y_up

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene
    from reference_sim.cloth import Cloth

FARTHEST = 0.25  # of the cloth's diagonal: a first frame lies nearer than that to the scene's cloth
BETTER_FIT = 0.5  # another unit or axis fits better where its distance is less than so much of the stated's
SIZE_RATIO = 2.0  # times as large, or as small, as the cloth a first frame may be
LONGEST_STRETCH = (
    3.0  # times as long as at rest, edges in the mean: they join vertices that are no neighbours
)
RATE_TOLERANCE = 1e-4  # of a frame rate: people write it with some digits
TURNED = 0.1  # of the cloth's diagonal: nearer than that it is not asked whether other axes fit better
# What a file's x and z may be where they are not the world's, with the matrix that mends them.
MIRRORS = {
    "mirrored in x": ((-1, 0), (0, 1)),
    "mirrored in z": ((1, 0), (0, -1)),
    "turned by 180 degrees about y": ((-1, 0), (0, -1)),
    "turned by 90 degrees about y": ((0, 1), (-1, 0)),
    "turned by -90 degrees about y": ((0, -1), (1, 0)),
}


def fit_to_scene(
    stored: StoredRollOut, scene: BuiltScene, stated: FileConventions
) -> tuple[StoredRollOut, tuple[str, ...]]:
    """Return the roll-out as the scene has it: metres, y up, its order of vertices, one position a frame.

    Args:
        stored: the roll-out as read.
        scene: the scene that it is said to belong to.
        stated: unit, axis and rate of the file, and whether its vertices are matched or of another mesh.

    Returns:
        The roll-out, and each change that was made, in words.

    Raises:
        RollOutFileError: with the remedy, without the file's name.

    >>> stored, changes = fit_to_scene(read_roll_out("mine.npz"), scene, FileConventions())  # doctest: +SKIP
    """
    count, cloth = stored.positions.shape[1], scene.cloth
    triangles = None if stored.faces is None else len(stored.faces)
    if stated.other_mesh and triangles is None:
        raise RollOutFileError(
            "has no triangles: add those of its own mesh (faces of an npz, .obj of a point cache)"
        )
    if stated.other_mesh and (count, triangles) == (cloth.vertex_count, len(cloth.faces)):
        raise RollOutFileError(
            f"has {count} vertices and {triangles} triangles as the scene's mesh: leave out "
            "other-mesh, or give match-vertices where they are in another order"
        )
    if not stated.other_mesh and count != cloth.vertex_count:
        raise RollOutFileError(
            f"has {count} vertices, the cloth of {scene.name} {cloth.vertex_count}: write one position for "
            "each vertex of the scene's mesh, of the same preset; corners split at seams are one vertex; or "
            "give other-mesh, to have surfaces compared alone"
        )
    if not np.isfinite(stored.positions[0]).all():
        raise RollOutFileError("its first frame, the scene's start, is not finite")
    expected = expected_positions(scene)
    _check_axes(stored, expected[0], stated)
    fitted = stored.mapped(partial(to_metres_y_up, units=stated.units, up=stated.up))
    order, change = None, f"another mesh of {count} vertices: surfaces are compared alone"
    if not stated.other_mesh:
        order, change = _order(fitted, scene, expected[0], stated)
    if order is not None:
        fitted = fitted.mapped(lambda positions: positions[:, order])
    timed, retimed = _retimed(fitted, scene, stated)
    changes = tuple(filter(None, (change, retimed)))
    if order is None and not stated.other_mesh:
        _check_sides(timed.positions[0], expected[0], "its first frame")
    frames = min(len(timed.positions), len(expected))
    if frames > 1:
        _check_sides(timed.positions[:frames].mean(axis=1), expected[:frames].mean(axis=1), "its way")
    _check_place(timed.positions, expected)
    return timed, changes


def expected_positions(scene: BuiltScene) -> np.ndarray:
    """Return the garment carried by the body's joints (T,V,3) [m]; without a body the start, (1,V,3)."""
    if scene.dressed is None:
        return scene.start[None]
    worn = scene.dressed
    body, garment, motion = worn.body, worn.garment, worn.motion
    kept = np.arange(motion.frames) if scene.kept is None else scene.kept
    transforms = body.transforms(motion.poses[kept], motion.translations[kept], worn.betas)
    rest = garment.rest_for(body, worn.betas)
    points = np.concatenate([rest, np.ones((len(rest), 1))], axis=1)
    spread = (garment.skinning_weights[:, :, None] * points[:, None, :]).reshape(len(rest), -1)
    columns = transforms.transpose(0, 1, 3, 2).reshape(len(kept), spread.shape[1], 3)
    return np.einsum("vk,tkc->tvc", spread, columns, optimize=True)


# --- unit, axes and place ----------------------------------------------------------------------------------


def _check_axes(stored: StoredRollOut, expected: np.ndarray, stated: FileConventions) -> None:
    """Raise RollOutFileError unless the first frame fits best with the stated unit and up axis."""
    first, size = stored.positions[0], _diagonal(expected)
    alike = [
        units for units in METRES if 1 / SIZE_RATIO < METRES[units] * _diagonal(first) / size < SIZE_RATIO
    ]
    if not alike:
        across = METRES[stated.units] * _diagonal(first)
        raise RollOutFileError(
            f"its first frame is {across:.3g} m across, the scene's cloth {size:.3g} m, in whatever unit of "
            f"{', '.join(METRES)}: write metres"
        )
    apart = {
        (units, up): _cloud_distance(to_metres_y_up(first, units=units, up=up), expected)
        for units in alike
        for up in UP_AXES
    }
    best, given = min(apart, key=lambda names: apart[names]), (stated.units, stated.up)
    here = apart.get(given, np.inf)
    if (
        best != given
        and apart[best] < BETTER_FIT * here
        and (given[0] not in alike or apart[best] < FARTHEST * size)
    ):
        pairs = zip(("units", "up"), best, given)
        remedy = [f"{name}={value}" for name, value, stated_value in pairs if value != stated_value]
        raise RollOutFileError(
            f"its first frame fits the scene's cloth in {best[0]}, {best[1]} up, {apart[best]:.2g} m off, "
            f"and not in {stated.units}, {stated.up} up: give {' '.join(remedy)}"
        )
    if here > FARTHEST * size:
        raise RollOutFileError(
            f"its first frame lies {here:.3g} m from where the scene's cloth starts: write world coordinates "
            "(not relative to the pelvis), from the scene's first frame on"
        )


def _check_sides(points: np.ndarray, expected: np.ndarray, what: str) -> None:
    """Raise RollOutFileError where points (N,3) lie nearer to the expected ones mirrored, or turned about y.

    Garments are alike on the left and on the right: only single points, or the way of the whole, show it.
    """
    whole = np.isfinite(points).all(axis=1)
    points, expected = points[whole], expected[whole]

    def apart(factors: tuple[tuple[int, int], tuple[int, int]] = ((1, 0), (0, 1))) -> float:
        mended = points.copy()
        mended[:, [0, 2]] = points[:, [0, 2]] @ np.array(factors, dtype=float).T
        return float(np.median(np.linalg.norm(mended - expected, axis=1)))

    here = apart()
    if here < TURNED * _diagonal(expected):
        return
    there, name = min((apart(factors), name) for name, factors in MIRRORS.items())
    if there < BETTER_FIT * here:
        raise RollOutFileError(
            f"{what} lies {here:.2g} m from where the scene has it, and {there:.2g} m if it is {name}: write "
            "the world's x, y, z of the scene's files (right-handed, y up)"
        )


def _check_place(positions: np.ndarray, expected: np.ndarray) -> None:
    """Raise RollOutFileError unless the cloth's centre stays with the body in most of the frames.

    A roll-out that explodes in the end is a result, one of another motion is none.
    """
    frames = min(len(positions), len(expected))
    if frames < 2:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        away = np.linalg.norm(positions[:frames].mean(axis=1) - expected[:frames].mean(axis=1), axis=1)
    far = np.flatnonzero(~(away <= FARTHEST * _diagonal(expected[0])))
    if 2 * len(far) > frames:
        frame = far[0]
        raise RollOutFileError(
            f"from frame {frame} on its centre lies {away[frame]:.2g} m from where the body carries it: "
            "another motion, another frame rate (fps=N), or coordinates that are not the world's"
        )


def _cloud_distance(points: np.ndarray, others: np.ndarray) -> float:
    """Return the mean distance [m] to the nearest point of the other set, both ways: blind to the order."""
    from scipy.spatial import cKDTree

    forth, back = cKDTree(others).query(points)[0], cKDTree(points).query(others)[0]
    return float(forth.mean() + back.mean()) / 2.0


def _diagonal(points: np.ndarray) -> float:
    """Return the diagonal of the bounding box [m]."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


# --- order of vertices -------------------------------------------------------------------------------------


def _order(
    stored: StoredRollOut, scene: BuiltScene, expected: np.ndarray, stated: FileConventions
) -> tuple[np.ndarray | None, str]:
    """Return the file's vertex for each of the scene's (V,), and how it was matched; None: the same order."""
    ours, first = scene.cloth.faces, stored.positions[0]
    remedy = "; give match-vertices" if not stated.match_vertices else ""
    if stored.faces is not None:
        if same_faces(stored.faces, ours):
            return None, ""
        if not stated.match_vertices:
            raise RollOutFileError(
                f"its {len(stored.faces)} triangles join other vertices than the scene's {len(ours)}: "
                f"vertices are missing or reordered{remedy}"
            )
        order = same_topology(stored.faces, ours, first, expected)
        if order is None:
            raise RollOutFileError(
                f"its {len(stored.faces)} triangles are another mesh than the scene's {len(ours)}, whatever "
                "the order: no vertex can be matched; export the scene's mesh and use that"
            )
        return order, "vertices matched by topology"
    shuffled = mean_stretch(first, scene.cloth) > LONGEST_STRETCH
    if not stated.match_vertices:
        if shuffled:
            raise RollOutFileError(
                "neighbours in the scene's mesh are no neighbours in its first frame: vertices are reordered"
                f"{remedy}"
            )
        return None, ""
    half = 0.5 * float(np.median(_lengths(scene.start, scene.cloth)))
    order = nearest_order(first, scene.start, reach=half)
    if order is None:
        raise RollOutFileError(
            "has no triangles, and its first frame is not the scene's start to within half an edge: vertices "
            "cannot be matched one to one; add its triangles (faces of an npz, .obj beside a point cache)"
        )
    return order, "vertices matched by nearest position in the first frame"


def _lengths(positions: np.ndarray, cloth: Cloth) -> np.ndarray:
    edges = cloth.edges
    return np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)


def mean_stretch(positions: np.ndarray, cloth: Cloth) -> float:
    """Return the mean length of the cloth's edges at positions (V,3) over that at rest."""
    return float(_lengths(positions, cloth).mean() / _lengths(cloth.rest_positions, cloth).mean())


# --- frame rate --------------------------------------------------------------------------------------------


def _retimed(stored: StoredRollOut, scene: BuiltScene, stated: FileConventions) -> tuple[StoredRollOut, str]:
    """Return a frame for each of the scene's, linear in time between the file's, and the change in words."""
    rate = 1.0 / scene.dt
    stated_rate, frames = stored.fps, len(stored.positions)
    if stated.fps is None and stated_rate is not None and abs(stated_rate - rate) > RATE_TOLERANCE * rate:
        raise RollOutFileError(
            f"states {stated_rate:g} frames a second, the scene has {rate:g}: give fps={stated_rate:g} to "
            "re-time it"
        )
    file_rate = rate if stated.fps is None else stated.fps
    if abs(file_rate - rate) <= RATE_TOLERANCE * rate:
        file_rate = rate
    places = np.arange(scene.frames) * file_rate / rate
    places = np.where(np.abs(places - np.round(places)) < 1e-6, np.round(places), places)
    spare = frames - 1 - places[-1]  # frames of the file behind the scene's last; up to one of the scene's
    if spare < 0.0 or spare > (0.0 if file_rate == rate else max(file_rate / rate, 1.0)):
        seconds = (frames - 1) / file_rate
        hint = _rate_hint(frames, scene.frames, rate) if stated.fps is None else ""
        raise RollOutFileError(
            f"has {frames} frames, {seconds:.3g} s at {file_rate:g} a second; the scene has "
            f"{scene.frames} with its start, {(scene.frames - 1) / rate:.3g} s{hint}"
        )
    if file_rate == rate:
        return stored, ""
    low = np.minimum(np.floor(places).astype(int), frames - 1)
    high, share = np.minimum(low + 1, frames - 1), (places - low)[:, None, None]

    def at(positions: np.ndarray) -> np.ndarray:
        return np.where(share > 0.0, (1.0 - share) * positions[low] + share * positions[high], positions[low])

    how = "every frame of the scene is one of the file" if not share.any() else "linear in between"
    change = f"re-timed from {file_rate:g} to {rate:g} frames a second, {how}"
    return stored.mapped(at, converged=None), change


def _rate_hint(frames: int, expected: int, rate: float) -> str:
    ratio = (frames - 1) / max(expected - 1, 1)
    guess = min((15, 24, 25, 50, 60, 90, 100, 120), key=lambda fps: abs(ratio - fps / rate))
    near = abs(ratio - guess / rate) < 0.05 * guess / rate
    return f": if it has {guess} a second, give fps={guess}" if near else ""
