"""A mesh that is no closed surface is refused as a body; the message names the element and the remedy."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim.cloth import MeshError
from reference_sim.geometry.topology import check_closed
from tests.reference_sim.meshes import box, sphere

BALL, FACES = sphere(1)
TURNED = np.where(np.arange(len(FACES))[:, None] == 3, FACES[:, ::-1], FACES)


def with_vertex(frame: int, vertex: int, place) -> np.ndarray:
    moving = np.stack([BALL, BALL, BALL])
    moving[frame, vertex] = place
    return moving


CUBE, CUBE_FACES = box((0, 0, 0), (1, 1, 1))
NUMBER = np.array([6, 7, *range(8, 14)])  # of a second cube: its first edge is the last of the first
CUBES = np.concatenate([CUBE, CUBE[2:] + np.array([1, 1, 0])])[None]


@pytest.mark.parametrize(
    ("positions", "faces", "message"),
    [
        (BALL, FACES, r"expected \(T, B, 3\) and \(F, 3\)"),
        (BALL[None][:0], FACES, r"obstacle \(0, 18, 3\)"),
        (BALL[None], FACES + 1, r"vertex outside 0\.\.17"),
        (with_vertex(1, 4, np.nan), FACES, "vertex 4 of frame 1 is not finite"),
        (with_vertex(2, FACES[5, 0], BALL[FACES[5, 1]]), FACES, "has no area in frame 2: remove it"),
        (BALL[None], FACES[1:], r"not closed: edge \(\d+, \d+\) of face \d+ has one face only: fill"),
        (BALL[None], TURNED, r"edge \(\d+, \d+\) of face \d+ .*wind all faces outwards"),
        (BALL[None], FACES[:, ::-1], "inside out .*reverse its faces"),
        (
            CUBES,
            np.concatenate([CUBE_FACES, NUMBER[CUBE_FACES]]),
            r"edge \((6, 7|7, 6)\) .* more than two",
        ),
    ],
)
def test_what_is_no_closed_surface(positions, faces, message):
    with pytest.raises(MeshError, match=message):
        check_closed(positions, faces)
