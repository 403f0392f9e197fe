"""Scenes that a roll-out brings itself: its rest mesh and its body have to be in its unit and axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.external.roll_out_files import RollOutFileError, RollOutOption
from benchmarks.scenes.from_roll_out import declared
from reference_sim.trajectory import write_obj
from tests.benchmarks.runner.tasks_by_hand import small_scene

SHEET = small_scene("hanging_sheet", cells=4, frames=5)
STANDING = np.array(
    [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.2, 0.0, 0.3], [0.2, 1.7, 0.1]]
)  # [m], head last
TETRAHEDRON = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])


def declare(folder: Path, rest_scale: float):
    """The scene of a sheet that stays where it starts, beside a body that stands there."""
    positions = np.repeat(SHEET.start[None], SHEET.frames, axis=0)
    obstacle = np.repeat(STANDING[None], SHEET.frames, axis=0)
    np.savez(
        folder / "pred.npz", positions=positions, faces=SHEET.cloth.faces, obstacle=obstacle,
        obstacle_faces=TETRAHEDRON,
    )  # fmt: skip
    write_obj(folder / "rest.obj", rest_scale * SHEET.cloth.rest_positions, SHEET.cloth.faces)
    option = RollOutOption("pred", str(folder / "pred.npz"))
    return declared(option, str(folder / "rest.obj"))


@pytest.mark.parametrize("rest_scale", [100.0, 0.01])
def test_a_rest_mesh_in_another_unit_is_refused(rest_scale, tmp_path):
    message = r"rest\.obj: .*pred\.npz .*one unit and order of vertices"
    with pytest.raises(RollOutFileError, match=message) as refused:
        declare(tmp_path, rest_scale).build()
    assert "\n" not in str(refused.value)
    for scale in (1.0, 0.5, 2.0):  # cloth may start stretched, or on a mesh that was scaled a little
        assert declare(tmp_path, scale).build().frames == SHEET.frames
