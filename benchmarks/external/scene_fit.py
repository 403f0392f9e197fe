"""Fit of a stored roll-out to a scene: unit, axes, order of vertices, frame rate and place are compared.

What does not fit is refused with the remedy and never guessed: a roll-out in centimetres would otherwise get
numbers, and nobody would see that they mean nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.external.roll_out_files import RollOutFileError, StoredRollOut
from reference_sim.files.mesh_files import to_metres_y_up

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene

FIRST = 0.15  # of the cloth's diagonal: a first frame lies nearer than that to the scene's cloth
FARTHEST = 0.25  # of the cloth's diagonal: its centre stays nearer than that to where the body carries it
RATE_TOLERANCE = 1e-4  # of a frame rate: people write it with some digits


def fit_to_scene(
    stored: StoredRollOut, scene: BuiltScene, *, units: str = "m", up: str = "y", fps: float | None = None,
    other_mesh: bool = False,
) -> StoredRollOut:  # fmt: skip
    """Return the roll-out in metres, y up, once it has been shown to belong to the scene.

    Args:
        stored: the roll-out as read.
        scene: the scene that it is said to belong to.
        units: of the file.
        up: vertical axis of the file.
        fps: frames per second of a file that does not state them.
        other_mesh: whether its vertices are those of another mesh of the garment.

    Raises:
        RollOutFileError: with the remedy, without the file's name.

    >>> fit_to_scene(read_roll_out("mine.npz"), scene, units="cm")  # doctest: +SKIP
    """
    (frames, count), cloth = stored.positions.shape[:2], scene.cloth
    if other_mesh and stored.faces is None:
        raise RollOutFileError(
            "has no triangles: add those of its own mesh (faces of an npz, .obj of a point cache)"
        )
    if not other_mesh and count != cloth.vertex_count:
        raise RollOutFileError(
            f"has {count} vertices, the cloth of {scene.name} {cloth.vertex_count}: write one position for "
            "each vertex of the scene's mesh, of the same sizes; corners split at seams are one vertex; or "
            "give other-mesh, to have surfaces compared alone"
        )
    if not other_mesh and stored.faces is not None and not _same_faces(stored.faces, cloth.faces):
        raise RollOutFileError(
            "its triangles join other vertices than the scene's: write the vertices in the order of the "
            "scene's mesh (rest.obj of an export), or give other-mesh, to have surfaces compared alone"
        )
    rate, stated = 1.0 / scene.dt, fps or stored.fps
    if stated is not None and abs(stated - rate) > RATE_TOLERANCE * rate:
        raise RollOutFileError(
            f"has {stated:g} frames a second, the scene {rate:g}: write one position for each of its frames"
        )
    if frames != scene.frames:
        raise RollOutFileError(f"has {frames} frames, the scene has {scene.frames} with its start")
    positions = to_metres_y_up(stored.positions, units=units, up=up)
    _check_place(positions, expected_positions(scene), ordered=not other_mesh)
    held = stored.quasi_static
    return replace(
        stored, positions=positions,
        quasi_static=None if held is None else to_metres_y_up(held, units=units, up=up),
    )  # fmt: skip


def _check_place(positions: np.ndarray, expected: np.ndarray, *, ordered: bool) -> None:
    """Raise RollOutFileError unless the cloth (T,V,3) [m] starts at the expected place and goes its way.

    Another unit, axis or order of vertices, a mirrored world and another motion are far from it. A roll-out
    that explodes in the end is a result: the way counts in most of the frames. Of another mesh the bounding
    boxes are compared.
    """
    first, size = positions[0], float(np.linalg.norm(np.ptp(expected[0], axis=0)))
    if not np.isfinite(first).all():
        raise RollOutFileError("its first frame, the scene's start, is not finite")
    if ordered:
        apart = float(np.median(np.linalg.norm(first - expected[0], axis=1)))
    else:
        apart = max(np.abs(end(first, axis=0) - end(expected[0], axis=0)).max() for end in (np.min, np.max))
    if not apart <= FIRST * size:
        across = float(np.linalg.norm(np.ptp(first, axis=0)))
        raise RollOutFileError(
            f"its first frame is {across:.3g} m across and lies {apart:.3g} m from the scene's cloth, which "
            f"is {size:.3g} m across: write metres, y up (or say units=cm, up=z), world coordinates, and the "
            "vertices in the order of the scene's mesh"
        )
    frames = min(len(positions), len(expected))
    with np.errstate(over="ignore", invalid="ignore"):
        away = np.linalg.norm(positions[:frames].mean(axis=1) - expected[:frames].mean(axis=1), axis=1)
    far = np.flatnonzero(~(away <= FARTHEST * size))
    if 2 * len(far) > frames:
        raise RollOutFileError(
            f"from frame {far[0]} on its centre lies {away[far[0]]:.2g} m from where the body carries it: "
            "another motion, another frame rate, or coordinates that are not the world's"
        )


def _same_faces(theirs: np.ndarray, ours: np.ndarray) -> bool:
    """Return whether two lists of triangles (F,3) join the same vertices, in any order and winding."""
    one, other = (np.unique(np.sort(faces, axis=1), axis=0) for faces in (theirs, ours))
    return theirs.shape == ours.shape and np.array_equal(one, other)


def expected_positions(scene: BuiltScene) -> np.ndarray:
    """Return the garment skinned to the poses (T,V,3) [m]; without a body the start, (1,V,3)."""
    return scene.start[None] if scene.skinned is None else scene.skinned
