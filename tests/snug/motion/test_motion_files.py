"""Files of motions: one motion in many forms, its vertical axis, recording errors. Damage: test_fuzz.py."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT, joint_positions
from snug.file_options import SPLITS, MotionFileOptions
from snug.motion.files import HAND_DAMPING, HANDS, load_motions
from snug.motion.library import LIBRARY, make_motion
from snug.motion.motion import Motion, clear_arms, place, resample, transition
from snug.motion.recording import are_positions, turn_y_up
from tests.snug.motion.motion_forms import (
    TO_Z_UP,
    Y_UP,
    amc_frame,
    of_root,
    read,
    refuse,
    write_clip,
    write_forms,
)

KICK = make_motion("kick").cut(0, 40)
WALK = make_motion("walk")


def write(path, motion, turn=Y_UP, **changes):
    """Write an .npz of a motion in a world turned by a matrix (3, 3)."""
    poses, trans = of_root(motion, turn)
    np.savez(path, **{"poses": poses, "trans": trans, "fps": motion.fps, **changes})
    return path


def angles(poses, others):
    """Return the angles between the rotations of two motions, (...) [rad]."""
    one, other = (Rotation.from_rotvec(p.reshape(-1, 3)) for p in (poses, others))
    return (one.inv() * other).magnitude()


@pytest.mark.parametrize("turn", [Y_UP, TO_Z_UP], ids=["y up", "z up"])
def test_one_motion_in_every_form_is_read_to_the_same_poses(tmp_path, turn):
    expected = place(KICK)
    expected.poses[:, HANDS] *= HAND_DAMPING
    for file in write_forms(tmp_path, KICK, turn):
        motion = resample(place(read(file)))
        exact = 1e-8 if file.suffix != ".bvh" else 1e-6
        assert motion.frames == KICK.frames and motion.fps == 30.0
        assert angles(motion.poses, expected.poses).max() < exact, file.name
        np.testing.assert_allclose(motion.translations, expected.translations, atol=exact)
    [loaded], spread = load_motions(file), clear_arms(motion)
    assert np.array_equal(loaded.poses, spread.poses) and loaded.name == file.stem


@pytest.mark.parametrize(("joints", "hand"), [(24, 0.05), (52, 0.0)])
def test_hands_are_damped_and_fingers_are_no_hands(tmp_path, joints, hand):
    poses = np.zeros((3, joints, 3))
    poses[:, 20:, 2] = 0.5
    path = write(tmp_path / "clip.npz", replace(KICK.cut(0, 3), poses=np.zeros((3, 24, 3))), poses=poses)
    np.testing.assert_allclose(read(path).poses[:, [20, 21, 22, 23], 2], [[0.05, 0.05, hand, hand]] * 3)


def spike(frame, joint="right_elbow", by=2.5):
    """Return poses of the kick in which one joint is turned further in one frame."""
    poses = KICK.poses.copy()
    further = Rotation.from_rotvec([0.0, by, 0.0])
    poses[frame, JOINT[joint]] = (further * Rotation.from_rotvec(poses[frame, JOINT[joint]])).as_rotvec()
    return poses


FROM_5 = np.arange(40)[:, None] >= 5
FAR = KICK.translations + np.where(FROM_5, [0.5, 0.0, 0.0], 0.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"poses": KICK.poses[:, :23, None]}, r"'poses' has shape \(40, 23, 1, 3\)"),
        ({"poses": KICK.poses[:, :21]}, "no array 'root_orient'"),
        ({"poses": np.degrees(KICK.poses)}, "radians, not degrees"),
        ({"trans": KICK.translations + 1e5}, "metres"),
        ({"trans": KICK.translations[1:]}, r"'trans' has shape \(39, 3\); give \(40, 3\)"),
        (
            {"trans": np.where(FROM_5, np.nan, KICK.translations)},
            "not finite in 35 frames, from frame 5 on",
        ),
        ({"poses": spike(20)}, "first of right_elbow before frame 20; cut"),
        ({"trans": FAR}, "first of the root before frame 5; cut"),
        ({"fps": 0}, "rates are 5 to 1000"),
    ],
)
def test_arrays_that_are_no_motion_are_refused(tmp_path, changes, words):
    refuse(write(tmp_path / "clip.npz", KICK, **changes), words)


def upside_down(poses):
    """The trunk folded down by half a turn above the pelvis."""
    return np.where(np.arange(24)[:, None] == JOINT["spine1"], [np.pi, 0.0, 0.0], poses)


PLACES = joint_positions(KICK.poses, KICK.translations)


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (PLACES, "holds positions of joints"),
        (1000 * PLACES[:, :22], "holds positions of joints"),
        (np.repeat(PLACES[:1, :22], 40, axis=0), "holds positions of joints"),
        (PLACES[:, ::-1], "holds positions of joints"),
        (PLACES - PLACES[:, :1], "holds positions of joints"),
        (upside_down(KICK.poses), "head is not above the pelvis in 100 % of the frames"),
    ],
    ids=["positions", "millimetres", "standing still", "another order", "root at zero", "upside down"],
)
def test_arrays_that_are_no_rotations_of_a_person_are_refused(tmp_path, poses, words):
    refuse(write(tmp_path / "clip.npz", KICK, poses=poses), words)


@pytest.mark.parametrize("name", LIBRARY)
def test_no_motion_of_the_library_is_taken_for_positions_or_no_person(name):
    motion = make_motion(name)
    assert not are_positions(motion.poses) and not are_positions(motion.poses[:1])
    turn_y_up(motion, "y")


def test_paths_without_a_motion_are_refused(tmp_path):
    notes, empty = tmp_path / "notes.txt", tmp_path / "empty"
    notes.write_text("hello")
    empty.mkdir()
    refuse(notes, "unknown kind")
    refuse(empty, "holds no")


def test_a_published_split_is_read_by_number_from_folders_of_cmu_and_amass(tmp_path):
    amass, cmu = tmp_path / "01", tmp_path / "07"
    for name in ("01_01_poses", "91_62_stageii", "01_01_stagei", "01_02_poses", "shape", "mine_91_61"):
        amass.mkdir(exist_ok=True)
        write(amass / f"{name}.npz", KICK)
    cmu.mkdir()
    write_clip(cmu, map(amc_frame, (1, 2, 3))).rename(cmu / "07_02.amc")
    write(cmu / "128_02.npz", KICK, poses=np.degrees(KICK.poses))
    with pytest.warns(UserWarning, match=r"128_02.npz: .* not degrees \(left out of split snug\)"):
        motions = load_motions(tmp_path, options=MotionFileOptions(split="snug"))
    assert [motion.name for motion in motions] == ["01_01", "91_62", "07_02"]
    write(cmu / "01_01.npz", KICK)
    refuse(tmp_path, "01_01 is in .*01_01_poses.npz and .*01_01.npz: leave one", split="snug")
    refuse(amass / "01_02_poses.npz", "holds no file of a clip of split hood", split="hood")


def test_splits_are_those_of_the_papers():
    sizes = {name: [len({*s["train"]}), len({*s["train"], *s["test"]})] for name, s in SPLITS.items()}
    assert sizes == {"snug": [52, 52 + 4], "hood": [52, 52 + 8]}


def test_a_rate_is_said_once(tmp_path):
    clip = write(tmp_path / "clip.npz", KICK)
    refuse(clip, "states 30 .* fps=60", fps=60.0)
    assert read(clip, fps=30.0).fps == 30.0
    assert read(write_clip(tmp_path, [amc_frame(1)]), fps=60.0).fps == 60.0
    np.savez(clip, poses=KICK.poses, trans=KICK.translations)
    refuse(clip, "no frame rate; add ,fps=N")


def test_a_body_that_walks_on_its_back_or_hangs_head_down_is_refused(tmp_path):
    refuse(write(tmp_path / "a.npz", WALK), "stands along z in 0 % .*,up=y", up="z")
    refuse(write(tmp_path / "a.npz", WALK, TO_Z_UP), "stands along y in 0 %", up="y")
    refuse(write(tmp_path / "a.npz", WALK, np.diag([1.0, -1.0, -1.0])), "stands along y in 0 %", up="y")


# Turns of joints [rad] of a body on the floor that does not stand on its feet, its head towards +z or down.
FLAT, FORWARD = (
    {"pelvis": (np.pi / 2, 0, 0)},
    {"left_shoulder": (0, -1.6, 0), "right_shoulder": (0, 1.6, 0)},
)
KNEELING = {f"{side}_{joint}": (way * np.pi / 2, 0, 0) for side in ("left", "right")
            for joint, way in (("hip", -1), ("knee", 1))}  # fmt: skip
LYING = {
    "crawls": FLAT | FORWARD | KNEELING,
    "plank": FLAT | FORWARD,
    "lies": {"pelvis": (-np.pi / 2, 0, 0), "left_shoulder": (0, 0, -1.3), "right_shoulder": (0, 0, 1.3)},
    "handstand": {"pelvis": (0, 0, np.pi), "left_shoulder": (0, 0, 1.6), "right_shoulder": (0, 0, -1.6)},
}


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("kind", LYING)
def test_who_does_not_stand_is_read_by_a_given_axis_and_refused_without(tmp_path, kind, up):
    poses, path = np.zeros((60, 24, 3)), np.outer(np.linspace(0, 0.4, 60), [0, 0, kind == "crawls"])
    for joint, turn in LYING[kind].items():
        poses[:, JOINT[joint]] = turn
    path[:, 1] -= joint_positions(poses, path)[..., 1].min()
    for heading in (0, 90, 180, 270):
        turn = (Y_UP if up == "y" else TO_Z_UP) @ Rotation.from_euler(
            "y", heading, degrees=True
        ).as_matrix()
        clip = write(tmp_path / "clip.npz", Motion(kind, poses, path), turn)
        refuse(clip, "add ,up=")
        pelvis, expected = (Rotation.from_rotvec(p[:, 0]).inv() for p in (read(clip, up=up).poses, poses))
        np.testing.assert_allclose(pelvis.apply([0, 1, 0]), expected.apply([0, 1, 0]), atol=1e-8)


@pytest.mark.parametrize("turn", [Y_UP, TO_Z_UP], ids=["y up", "z up"])
def test_a_fall_passes(tmp_path, turn):
    standing = WALK.cut(0, 30)
    lying = standing.poses[-1].copy()
    lying[0] = (Rotation.from_euler("x", -90, degrees=True) * Rotation.from_rotvec(lying[0])).as_rotvec()
    fall = transition(standing.poses[-1], lying, 12)
    poses = np.concatenate([standing.poses, fall, np.repeat(lying[None], 14, axis=0)])
    path = np.zeros((len(poses), 3))
    path[:30], path[30:] = standing.translations, standing.translations[-1]
    path[30:, 1] -= np.minimum(np.arange(26) / 12, 1.0) * 0.75
    motion = read(write(tmp_path / "fall.npz", Motion("fall", poses, path), turn))
    assert "as the body stands in 6" in motion.source or "as the body stands in 7" in motion.source
    expected = place(Motion("", poses, path)).translations
    np.testing.assert_allclose(place(motion).translations, expected, atol=1e-9)
