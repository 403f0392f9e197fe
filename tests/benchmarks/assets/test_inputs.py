"""A user's files are read once, and known again by what was read."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.assets import InputError, read_inputs
from benchmarks.plan.study import read_study
from benchmarks.runner.execute_plan import check_roll_outs
from benchmarks.score import plan_score
from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from tests.benchmarks.plan.planned import planned


class Openings:
    """Counts how often Python opens the files of a folder; a hook cannot be taken away, but rests."""

    def __init__(self) -> None:
        self.folder, self.count = "", Counter[str]()
        sys.addaudithook(self._note)

    def _note(self, event: str, arguments: tuple) -> None:
        if self.folder and event == "open" and str(arguments[0]).startswith(self.folder):
            self.count[Path(str(arguments[0])).name] += 1


@pytest.fixture(scope="module")
def hook():
    """One for these tests: it is asked at every opening of the process from here on."""
    return Openings()


@pytest.fixture
def openings(hook, tmp_path):
    hook.folder = str(tmp_path / "mine")
    hook.count.clear()
    yield hook.count
    hook.folder = ""


def write_motions(folder: Path, *names: str, frames: int = 12) -> str:
    folder.mkdir(exist_ok=True)
    for name in names:
        poses = np.zeros((frames, 52 * 3))
        np.savez(folder / f"{name}.npz", poses=poses, trans=np.zeros((frames, 3)), mocap_framerate=30.0)
    return str(folder)


def write_body(path: Path, scale: float = 1.0) -> str:
    body = Body.load()
    arrays = {"v_template": body.template, "shapedirs": body.shape_directions}
    arrays |= {"J_template": body.joint_template, "J_shapedirs": body.joint_directions}
    table = np.stack([np.maximum(body.parents, 0), np.arange(24)])
    scaled = {name: scale * array for name, array in arrays.items()}
    np.savez(path, f=body.faces, weights=body.skinning_weights, kintree_table=table, **scaled)
    return str(path)


def write_garment(path: Path) -> str:
    shirt = find_template("tshirt").tailor(Body.load(), vertices=300)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in shirt.rest_positions.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (shirt.faces + 1).tolist()]
    path.write_text("\n".join(lines))
    return str(path)


def test_each_file_of_a_run_is_opened_once_before_its_tasks(tmp_path, openings):
    mine = tmp_path / "mine"
    mine.mkdir()
    body, garment = write_body(mine / "body.npz"), write_garment(mine / "top.obj")
    motions = write_motions(mine / "clips", "sway")
    scenes = ["--scenes", "top/sway", "--methods", "skinning", "smoke:garments"]
    options = [*scenes, "--body", body, "--garment", garment, "--motions", motions, "--test-motions", "sway"]
    np.savez(mine / "out.npz", positions=np.zeros((12, 3, 3)), faces=[[0, 1, 2]])
    openings.clear()
    options += ["--rollout", f"out={mine}/out.npz", "-o", str(tmp_path / "run")]
    plan = planned(*options)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("benchmarks.methods.outside.fit_to_scene", lambda stored, *_: (stored, []))
        assets = check_roll_outs(plan)
    assert assets is not None and assets.body is plan.inputs.wearer
    assert assets.garments["top"] is plan.inputs.garment.garment
    assert openings == {"body.npz": 1, "top.obj": 1, "sway.npz": 1, "out.npz": 1}


def test_a_roll_out_that_brings_its_own_scene_is_opened_once(tmp_path, openings):
    mine = tmp_path / "mine"
    mine.mkdir()
    positions = np.zeros((6, 4, 3))
    positions[:, :, :2] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    np.savez(mine / "out.npz", positions=positions, faces=[[0, 1, 2], [0, 2, 3]])
    (mine / "rest.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n")
    openings.clear()
    plan = plan_score(
        read_study(),
        f"{mine}/out.npz",
        rest_mesh=f"{mine}/rest.obj",
        reference=False,
        folder=tmp_path / "run",
    )
    check_roll_outs(plan)
    assert openings == {"out.npz": 1, "rest.obj": 1}


def test_digests_are_of_what_was_read(tmp_path):
    one, same, other = (write_body(tmp_path / f"{n}.npz", scale) for n, scale in enumerate((1.0, 1.0, 1.1)))
    first, second, third = (read_inputs(body=Path(file)).body.digest for file in (one, same, other))
    assert first == second != third


@pytest.mark.parametrize(
    ("names", "frames", "message"),
    [(("d",), 2, "2 frames; at least 3 are needed"), (("walk",), 12, "'walk' is taken; rename the file")],
)
def test_a_motion_that_cannot_take_part_is_refused(names, frames, message, tmp_path):
    with pytest.raises(InputError, match=message):
        read_inputs(motions=[write_motions(tmp_path, *names, frames=frames)])


def test_two_motions_of_one_name_are_refused(tmp_path):
    folder = write_motions(tmp_path, "a", "b")
    assert set(read_inputs(motions=[folder, "library"]).motions) == {"a", "b"}
    with pytest.raises(InputError, match="'a' is taken"):
        read_inputs(motions=[folder, folder])
