"""A user's files are known again by what was read, and motions that cannot take part are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.assets import InputError, read_inputs
from snug.body.parametric_body import Body


def write_motions(folder: Path, *names: str, frames: int = 12) -> str:
    folder.mkdir(exist_ok=True)
    for name in names:
        poses = np.zeros((frames, 52 * 3))
        np.savez(folder / f"{name}.npz", poses=poses, trans=np.zeros((frames, 3)), mocap_framerate=30.0)
    return str(folder)


def write_body(path: Path, scale: float = 1.0) -> str:
    body = Body.load()
    arrays = {"v_template": body.template, "J_template": body.joint_template}
    table = np.stack([np.maximum(body.parents, 0), np.arange(24)])
    scaled = {name: scale * array for name, array in arrays.items()}
    np.savez(path, f=body.faces, weights=body.skinning_weights, kintree_table=table, **scaled)
    return str(path)


def test_digests_are_of_what_was_read(tmp_path):
    one, same, other = (
        write_body(tmp_path / f"{n}.npz", scale) for n, scale in enumerate((1.0, 1.0, 1.1))
    )
    first, second, third = (read_inputs(body=Path(file)).body.digest for file in (one, same, other))
    assert first == second != third


@pytest.mark.parametrize(
    ("names", "frames", "message"),
    [(("d",), 2, "2 frames; at least 3 are needed"), (("walk",), 12, "'walk' is taken; rename the file")],
)
def test_a_motion_that_cannot_take_part_is_refused(names, frames, message, tmp_path):
    with pytest.raises(InputError, match=message):
        read_inputs(motions=[write_motions(tmp_path, *names, frames=frames)])
