"""A run that was cut off goes on to the same bits, whenever and however it was cut off."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from reference_sim import Cloth, Material, Obstacle, Trajectory, TrajectoryError, TrajectoryWriter, simulate
from reference_sim.energies import BendHinge, ContactFriction, ContactPenalty, Gravity, StretchStVK
from reference_sim.trajectory.writer import INDEX_THAT_GROWS
from tests.reference_sim.meshes import grid, sphere

FRAMES = 7
BALL, BALL_FACES = sphere(3, 0.2)
SHEET, SHEET_FACES = grid(7, 7, width=0.5, depth=0.5)
CLOTH = Cloth(SHEET + np.array([-0.25, 0.204, -0.25]), SHEET_FACES)
PINNED = Cloth(SHEET, SHEET_FACES, pins=[0, 7])


class Cut(Exception):
    """Ends a run in the middle."""


def on_a_moving_ball(**changes):
    """A sheet with friction on a ball that moves aside: terms of this remember the step before."""
    moving = np.stack([BALL + np.array([0.01 * k, 0, 0]) for k in range(FRAMES)])
    contact = ContactPenalty(CLOTH)
    terms = [StretchStVK(CLOTH), BendHinge(CLOTH), Gravity(CLOTH), contact, ContactFriction(contact)]
    obstacle = Obstacle(moving, BALL_FACES, rest_positions=BALL, region=0.3)
    return {"cloth": CLOTH, "energies": terms, "obstacle": obstacle, "frames": FRAMES} | changes


def waved(**changes):
    """A sheet with two corners that a hand waves, thrown at the start."""
    corners = SHEET[[0, 7]]
    velocity = np.tile([0.3, 1.0, 0.0], (len(SHEET), 1))
    return {
        "cloth": PINNED,
        "energies": [StretchStVK(PINNED), BendHinge(PINNED), Gravity(PINNED)],
        "pin_positions": lambda k: corners + np.array([0.0, 0.03 * np.sin(k), 0.01 * k]),
        "velocity": velocity,
        "frames": FRAMES,
    } | changes


SCENES = {
    "friction": on_a_moving_ball,
    "friction, sub-steps": lambda **c: on_a_moving_ball(substeps=3, **c),
    "handles": waved,
    "handles, sub-steps": lambda **c: waved(substeps=2, **c),
    "quasi-static": lambda **c: waved(quasi_static=True, guess="previous", **c),
}


def cut_off(path: Path, scene, frames: int) -> None:
    """Write `frames` frames of the scene into path and then die in the middle of the next."""
    arguments = scene()
    moves = arguments.get("pin_positions") or (lambda k: arguments["cloth"].rest_positions[:0])

    def pin_positions(frame):
        if frame == frames:
            raise Cut
        return moves(frame)

    with pytest.raises(Cut):
        simulate(**arguments | {"pin_positions": pin_positions}, path=path)
    assert Trajectory.load(path).status == "unfinished"
    assert Trajectory.load(path).frames == frames


def assert_same(a: Trajectory, b: Trajectory) -> None:
    """Bit for bit, except for the clock."""
    np.testing.assert_array_equal(a.positions, b.positions)
    np.testing.assert_array_equal(a.times, b.times)
    assert a.frame_fields.keys() == b.frame_fields.keys()
    for name, values in a.frame_fields.items():
        np.testing.assert_array_equal(values, b.frame_fields[name], err_msg=name)
    assert (a.status, a.reason, a.provenance) == (b.status, b.reason, b.provenance)


@pytest.fixture(scope="module")
def unbroken():
    return {name: simulate(**scene()) for name, scene in SCENES.items()}


@pytest.mark.parametrize("frames", [1, 2, 4])
@pytest.mark.parametrize("name", SCENES)
def test_resumed_is_the_unbroken_run_bit_for_bit(tmp_path, unbroken, name, frames):
    path = tmp_path / "run.vtkhdf"
    assert unbroken[name].status == "converged"
    cut_off(path, SCENES[name], frames)
    resumed = simulate(**SCENES[name](), path=path, resume=True)
    assert_same(resumed, unbroken[name])
    assert_same(Trajectory.load(path), unbroken[name])
    assert os.listdir(tmp_path) == ["run.vtkhdf"]


def test_resumed_twice(tmp_path, unbroken):
    path, scene = tmp_path / "run.vtkhdf", SCENES["friction, sub-steps"]
    cut_off(path, scene, 2)
    simulate(**scene() | {"frames": 5}, path=path, resume=True)  # ended by itself, and is asked to go on
    assert_same(simulate(**scene(), path=path, resume=True), unbroken["friction, sub-steps"])


def test_without_a_file_it_starts_at_the_beginning(tmp_path, unbroken):
    path = tmp_path / "run.vtkhdf"
    assert_same(simulate(**waved(), path=path, resume=True), unbroken["handles"])
    assert path.exists()


def test_a_finished_run_is_only_read(tmp_path, unbroken):
    path = tmp_path / "run.vtkhdf"
    simulate(**waved(), path=path)
    before = path.read_bytes()
    assert_same(simulate(**waved(), path=path, resume=True), unbroken["handles"])
    assert path.read_bytes() == before


def test_the_first_failure_is_remembered(tmp_path):
    def scene(**changes):
        return waved(max_iterations=1, **changes)

    whole = simulate(**scene())
    assert whole.status == "max_iterations" and whole.reason.startswith("frame 1: ")
    cut_off(tmp_path / "run.vtkhdf", scene, 4)
    assert_same(simulate(**scene(), path=tmp_path / "run.vtkhdf", resume=True), whole)


KILLED = """
import sys
import numpy as np
sys.path.insert(0, {tests!r})
from tests.reference_sim.trajectory.test_resume import waved
from reference_sim import simulate
scene = waved(substeps=2)
moves = scene["pin_positions"]
def pin_positions(frame):
    print(frame, flush=True)
    return moves(frame)
scene["pin_positions"] = pin_positions
scene["frames"] = 2000
simulate(**scene, path={path!r})
"""


def start(code: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def test_killed_with_signal_9(tmp_path):
    path = tmp_path / "run.vtkhdf"
    process = start(KILLED.format(tests=str(Path(__file__).resolve().parents[3]), path=str(path)))
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) == 5:
            break
    process.kill()
    process.wait()
    process.stdout.close()
    held = Trajectory.load(path)
    assert held.status == "unfinished" and held.frames >= 5
    frames = held.frames + 2
    resumed = simulate(**waved(substeps=2, frames=frames), path=path, resume=True)
    np.testing.assert_array_equal(resumed.positions[: held.frames], held.positions)
    assert_same(resumed, simulate(**waved(substeps=2, frames=frames)))


class Recorded(io.RawIOBase):
    """File for HDF5 that keeps each write, (offset, bytes), in its order."""

    def __init__(self, path):
        self.file, self.writes = open(path, "r+b"), []  # noqa: SIM115 (HDF5 keeps it)

    def write(self, data):
        self.writes.append((self.file.tell(), bytes(data)))
        return self.file.write(data)

    def __getattribute__(self, name):
        if name in ("seek", "tell", "readinto", "truncate", "flush"):
            return getattr(self.file, name)
        return super().__getattribute__(name)


def test_killed_between_any_two_writes_of_hdf5(tmp_path):
    """An index of 64 blocks is split between the frames that are appended: its parts are written in turn."""
    path, copy = tmp_path / "run.vtkhdf", tmp_path / "killed.vtkhdf"
    x = np.arange(30.0).reshape(10, 3)
    with TrajectoryWriter(path, np.array([[0, 1, 2]]), {}, vertex_count=10) as writer:
        writer.go_live()
        for k in range(60):
            writer.append(x + k, 0.1 * k, 1.0, {"energy/strain": 1.0 * k}, before=np.stack([x, x + k]))
        writer._file.close()
        killed = bytearray(path.read_bytes())
        recorded = Recorded(path)
        writer._file = h5py.File(recorded, "r+", libver=INDEX_THAT_GROWS)
        whole = []  # frames that are whole before each write
        for k in range(60, 68):
            writer.append(x + k, 0.1 * k, 1.0, {"energy/strain": 1.0 * k}, before=np.stack([x, x + k]))
            whole += [k] * (len(recorded.writes) - len(whole))
    recorded.file.close()
    assert len(recorded.writes) > 100
    for (start, data), frames in zip(recorded.writes, whole, strict=False):
        killed[start : start + len(data)] = data
        copy.write_bytes(killed)
        held = Trajectory.load(copy)
        assert frames <= held.frames <= frames + 1
        assert held.frames == len(held.times) == len(held.frame_seconds)
        k = np.arange(held.frames)
        np.testing.assert_array_equal(held.positions, x + k[:, None, None])
        np.testing.assert_array_equal(held.frame_fields["energy/strain"], k)


def test_of_a_file_cut_short_the_whole_frames_are_saved(tmp_path, unbroken):
    path = tmp_path / "run.vtkhdf"
    cut_off(path, waved, 5)
    with h5py.File(path) as file:
        info = [file["VTKHDF/Points"].id.get_chunk_info(k) for k in range(5)]
    os.truncate(path, info[3].byte_offset + info[3].size // 2)
    with pytest.raises(TrajectoryError, match="not a VTKHDF trajectory"):
        Trajectory.load(path)
    resumed = simulate(**waved(), path=path, resume=True)
    assert_same(resumed, unbroken["handles"])
    assert_same(Trajectory.load(path), unbroken["handles"])
    assert os.listdir(tmp_path) == ["run.vtkhdf"]


@pytest.mark.parametrize("damage", ["rubbish", "empty", "head only", "no frame", "other file"])
def test_what_cannot_be_read_is_said_in_one_line_and_left_alone(tmp_path, damage):
    path = tmp_path / "run.vtkhdf"
    cut_off(path, waved, 3)
    whole = path.read_bytes()
    if damage == "other file":
        with h5py.File(path, "w") as file:
            file["data"] = 1.0
    else:
        content = {"rubbish": b"rubbish" * 99, "empty": b"", "head only": whole[:600], "no frame": whole}[
            damage
        ]
        path.write_bytes(content)
    if damage == "no frame":
        with h5py.File(path, "r+") as file:
            file["benchmark"].attrs.modify("frames", 0)
    damaged = path.read_bytes()
    with pytest.raises(TrajectoryError, match=r"run\.vtkhdf: nothing to resume: .*remove it") as caught:
        simulate(**waved(), path=path, resume=True)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == damaged and os.listdir(tmp_path) == ["run.vtkhdf"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dt": 0.02}, r"dt_s \(0\.0333.*, now 0\.02\)"),
        ({"substeps": 2}, r"substeps \(1, now 2\)"),
        ({"tolerance": 1e-5}, r"options\.tolerance \(None, now 1e-05\)"),
        ({"start": SHEET + np.array([0, 0.1, 0])}, "start "),
        ({"velocity": None}, "start "),
        ({"quasi_static": True}, "quasi_static "),
        ({"energies": [StretchStVK(PINNED), Gravity(PINNED)]}, r"terms\.bending"),
        (
            {"energies": [StretchStVK(PINNED), BendHinge(PINNED, rest_angles=0.1), Gravity(PINNED)]},
            r"terms\.bending\.rest",
        ),
        ({"pin_positions": lambda k: SHEET[[0, 7]]}, "pins at frame 2"),
        ({"frames": 2}, "holds 3 frames already, more than the 2 asked for"),
    ],
)
def test_another_run_is_refused_by_what_differs(tmp_path, changes, message):
    path = tmp_path / "run.vtkhdf"
    cut_off(path, waved, 3)
    before = path.read_bytes()
    with pytest.raises(TrajectoryError, match=message):
        simulate(**waved(**changes), path=path, resume=True)
    assert path.read_bytes() == before


def test_another_cloth_or_obstacle_is_refused(tmp_path):
    path = tmp_path / "run.vtkhdf"
    cut_off(path, on_a_moving_ball, 2)
    ball = Obstacle(np.stack([BALL, BALL + 0.001]), BALL_FACES, rest_positions=BALL, region=0.3)
    with pytest.raises(TrajectoryError, match=r"differing in obstacle \("):
        simulate(**on_a_moving_ball(obstacle=ball), path=path, resume=True)
    stiff = Cloth(CLOTH.rest_positions, CLOTH.faces, Material(young_modulus=80e3))
    contact = ContactPenalty(stiff)
    terms = [StretchStVK(stiff), BendHinge(stiff), Gravity(stiff), contact, ContactFriction(contact)]
    with pytest.raises(TrajectoryError, match=r"material\.young_modulus \(70000\.0, now 80000\.0\)"):
        simulate(**on_a_moving_ball(cloth=stiff, energies=terms), path=path, resume=True)


def test_a_cloth_without_hinges_goes_on_where_it_was(tmp_path):
    one = Cloth(np.eye(3), np.array([[0, 1, 2]]), pins=[0])
    scene = {"cloth": one, "energies": [StretchStVK(one), BendHinge(one), Gravity(one)]}
    simulate(**scene, frames=2, path=tmp_path / "run.vtkhdf")
    assert simulate(**scene, frames=3, path=tmp_path / "run.vtkhdf", resume=True).frames == 3


def test_a_lost_sub_step_is_said(tmp_path):
    path = tmp_path / "run.vtkhdf"
    cut_off(path, SCENES["handles, sub-steps"], 5)
    with h5py.File(path, "r+") as file:
        file["benchmark"].attrs.modify("frames", 5)
        del file["benchmark/before_last_step"]
    with pytest.raises(TrajectoryError, match=re.escape("sub-step before frame 4 is lost: start again")):
        simulate(**SCENES["handles, sub-steps"](), path=path, resume=True)


def test_a_file_appears_when_told_or_at_the_end_or_not_at_all(tmp_path):
    faces = np.array([[0, 1, 2]])
    path = tmp_path / "run.vtkhdf"
    with pytest.raises(Cut), TrajectoryWriter(path, faces, {}, vertex_count=3):
        raise Cut
    assert os.listdir(tmp_path) == []
    with pytest.raises(Cut), TrajectoryWriter(path, faces, {}, vertex_count=3) as writer:
        writer.append(np.zeros((3, 3)), 0.0)
        writer.go_live()
        raise Cut
    assert Trajectory.load(path).frames == 1
    with pytest.raises(Cut), TrajectoryWriter(path, faces, {}, vertex_count=3) as writer:
        writer.append(np.ones((3, 3)), 0.0)
        raise Cut
    assert not Trajectory.load(path).positions.any()  # the old one is still there
    assert os.listdir(tmp_path) == ["run.vtkhdf"]
