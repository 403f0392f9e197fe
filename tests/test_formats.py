"""Motion files: a tiny skeleton with known answers, every kind of broken file, and real clips."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body import Body
from snug.formats.asf_amc import CMU_RATE, INCH, read_amc, read_asf, read_asf_amc
from snug.formats.retarget import GLITCH, JOINT_BONES, LIMBS, local_turns, repair, world_turns
from snug.motion import MotionError, load_motions
from snug.skeleton import JOINT, global_rotations, joint_positions, rotation_matrices, sole_points

CLIPS = Path(os.environ.get("CMU_MOTIONS", Path(__file__).parents[2] / "shared/data/cmu"))
UNIT = 0.45
METRES = INCH / UNIT

# A two-bone skeleton for the parser: the second bone's own axes are turned by 90 degrees about z.
CHAIN = """# comment
:version 1.10
:name CHAIN
:units
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name upper
     direction 0 2 0
     length 10
     axis 0 0 0 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name lower
     direction 0 1 0
     length 5
     axis 0 0 90 XYZ
    dof rx
  end
:hierarchy
  begin
    root upper
    upper lower
  end
"""


def cmu_like(splay: float = 20.0, radians: bool = False) -> str:
    """A skeleton with CMU's bone names: legs splayed, arms along x, hinge axes tilted as CMU's are."""
    s, c = np.sin(np.radians(splay)), np.cos(np.radians(splay))
    down, up = {"l": (s, -c, 0), "r": (-s, -c, 0)}, (0, 1, 0)
    bones = [
        ("lowerback", up, 2, (0, 0, 0), "rx ry rz", "root"),
        ("upperback", up, 2, (0, 0, 0), "", "lowerback"),
        ("thorax", up, 2, (0, 0, 0), "", "upperback"),
        ("lowerneck", up, 2, (0, 0, 0), "", "thorax"),
        ("upperneck", up, 2, (0, 0, 0), "", "lowerneck"),
        ("head", up, 2, (0, 0, 0), "rx", "upperneck"),
    ]
    for side, sign in (("l", 1), ("r", -1)):
        leg, arm = (0, 0, sign * splay), (180, -sign * 30, -sign * 90)
        bones += [
            (f"{side}hipjoint", (sign * 0.6, -0.7, 0.3), 2.4, (0, 0, 0), "", "root"),
            (f"{side}femur", down[side], 7.0, leg, "rx ry rz", f"{side}hipjoint"),
            (f"{side}tibia", down[side], 7.4, leg, "rx", f"{side}femur"),
            (f"{side}foot", (0, -0.2, 0.98), 2.3, (-90, 0, 0), "rx", f"{side}tibia"),
            (f"{side}toes", (0, 0, 1), 1.1, (-90, 0, 0), "", f"{side}foot"),
            (f"{side}clavicle", (sign * 0.93, 0.35, 0), 3.5, (0, 0, 0), "ry rz", "thorax"),
            (f"{side}humerus", (sign, 0, 0), 5.0, arm, "rx ry rz", f"{side}clavicle"),
            (f"{side}radius", (sign, 0, 0), 3.5, arm, "rx", f"{side}humerus"),
            (f"{side}wrist", (sign, 0, 0), 1.7, (0, sign * 90, sign * 90), "ry", f"{side}radius"),
            (f"{side}hand", (sign, 0, 0), 0.7, (0, sign * 90, sign * 90), "rx", f"{side}wrist"),
            (f"{side}fingers", (sign, 0, 0), 0.6, (0, sign * 90, sign * 90), "", f"{side}hand"),
        ]  # fmt: skip
    turn = np.pi / 180 if radians else 1.0
    text = f":units\n length {UNIT}\n angle {'rad' if radians else 'deg'}\n:root\n order TX TY TZ RX RY RZ\n"
    text += " axis XYZ\n position 0 0 0\n orientation 0 0 0\n:bonedata\n"
    for name, direction, length, axis, dof, _ in bones:
        text += f"begin\n name {name}\n direction {' '.join(map(str, direction))}\n length {length}\n"
        text += (
            f" axis {' '.join(str(a * turn) for a in axis)} XYZ\n"
            + (f" dof {dof}\n" if dof else "")
            + "end\n"
        )
    return text + ":hierarchy\nbegin\n" + "".join(f" {b[5]} {b[0]}\n" for b in bones) + "end\n"


def amc_frame(number: int, **bones: tuple[float, ...]) -> str:
    """One frame of the CMU-like skeleton: zero everywhere but for the bones given."""
    counts = {"root": 6, "lowerback": 3, "head": 1}
    for side in "lr":
        counts |= {f"{side}femur": 3, f"{side}tibia": 1, f"{side}foot": 1, f"{side}clavicle": 2}
        counts |= {f"{side}humerus": 3, f"{side}radius": 1, f"{side}wrist": 1, f"{side}hand": 1}
    values = {name: bones.get(name, (0.0,) * count) for name, count in counts.items()}
    return f"{number}\n" + "".join(f"{name} {' '.join(map(str, v))}\n" for name, v in values.items())


def write_clip(folder: Path, frames: list[str], *, name: str = "07_01", skeleton: str | None = None) -> Path:
    (folder / f"{name.split('_')[0]}.asf").write_text(skeleton or cmu_like())
    clip = folder / f"{name}.amc"
    clip.write_text(":FULLY-SPECIFIED\n:DEGREES\n" + "".join(frames))
    return clip


class TestParser:
    def test_lengths_axes_and_hierarchy(self, tmp_path):
        path = tmp_path / "chain.asf"
        path.write_text(CHAIN)
        skeleton = read_asf(path)
        assert list(skeleton.bones) == ["root", "upper", "lower"]
        upper, lower = skeleton.bones["upper"], skeleton.bones["lower"]
        assert upper.length == pytest.approx(10 * 0.0254 / 0.45)
        np.testing.assert_allclose(upper.direction, [0, 1, 0])  # made unit length
        assert (upper.channels, lower.channels, lower.parent) == (("rx", "ry", "rz"), ("rx",), "upper")
        np.testing.assert_allclose(lower.axes, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)

    def test_forward_kinematics_by_hand(self, tmp_path):
        (tmp_path / "chain.asf").write_text(CHAIN)
        clip = tmp_path / "chain.amc"
        clip.write_text(
            "1\nroot 1 2 3 0 0 0\nupper 0 0 90\nlower 0\n2\nroot 0 0 0 0 90 0\nupper 90 90 0\nlower 90\n"
        )
        skeleton = read_asf(tmp_path / "chain.asf")
        channels = read_amc(clip, skeleton)
        np.testing.assert_allclose(channels["root"][0, :3], np.array([1, 2, 3]) * METRES)
        local = {name: local_turns(skeleton, channels, name, 2) for name in skeleton.bones}
        turned = world_turns(skeleton, local)
        up = np.array([0.0, 1.0, 0.0])
        # Frame 1: the upper bone lies along -x, and the lower one with it.
        np.testing.assert_allclose(turned["upper"][0] @ up, [-1, 0, 0], atol=1e-12)
        np.testing.assert_allclose(turned["lower"][0] @ up, [-1, 0, 0], atol=1e-12)
        # Frame 2: x first: up -> +z; then y: z -> +x; the root's own quarter turn about y: x -> -z.
        np.testing.assert_allclose(turned["upper"][1] @ up, [0, 0, -1], atol=1e-12)
        # The lower bone's x axis is the world's y axis: it twists about itself and points on.
        np.testing.assert_allclose(turned["lower"][1] @ up, [0, 0, -1], atol=1e-12)
        np.testing.assert_allclose(
            local["lower"][1], Rotation.from_euler("y", 90, degrees=True).as_matrix(), atol=1e-12
        )

    def test_radians_and_degrees_agree(self, tmp_path):
        frames = [amc_frame(1, lfemur=(-40, 10, 5), root=(0, 17, 0, 10, 20, 30))]
        degrees = read_asf_amc(write_clip(tmp_path, frames))
        turned = [
            amc_frame(1, lfemur=tuple(np.radians([-40, 10, 5])), root=(0, 17, 0, *np.radians([10, 20, 30])))
        ]
        clip = write_clip(tmp_path, turned, name="08_01", skeleton=cmu_like(radians=True))
        clip.write_text(clip.read_text().replace(":DEGREES", ":RADIANS"))
        np.testing.assert_allclose(read_asf_amc(clip).poses, degrees.poses, atol=1e-12)


class TestRetargeting:
    def limb(self, motion, joint, frame=0):
        positions = joint_positions(motion.poses, motion.translations)[frame]
        arm = positions[JOINT[LIMBS[joint]]] - positions[JOINT[joint]]
        return arm / np.linalg.norm(arm)

    def test_the_zero_pose_has_the_files_limb_directions(self, tmp_path):
        motion = read_asf_amc(write_clip(tmp_path, [amc_frame(1)]))
        s, c = np.sin(np.radians(20)), np.cos(np.radians(20))
        expected = {
            "left_hip": (s, -c, 0),
            "right_knee": (-s, -c, 0),
            "left_shoulder": (1, 0, 0),
            "right_elbow": (-1, 0, 0),
        }
        for joint, direction in expected.items():
            np.testing.assert_allclose(self.limb(motion, joint), direction, atol=1e-9)
        # No turn where the skeletons agree; hips not twisted: the knees' hinge still lies across.
        np.testing.assert_allclose(motion.poses[0, JOINT["spine2"]], 0.0, atol=1e-12)
        hinge = global_rotations(motion.poses)[0, JOINT["left_knee"]] @ [1, 0, 0]
        # Within the 3 degrees by which our own rest shank is splayed, and no more about the leg's length.
        np.testing.assert_allclose(hinge, [c, s, 0], atol=0.06)
        assert abs(hinge[2]) < 1e-9

    def test_flexions_bend_the_right_way(self, tmp_path):
        # The femur's axes are splayed by 20 degrees; rz brings the leg upright, then rx swings it forward.
        frames = [
            amc_frame(1, lfemur=(-90, 0, 0), rtibia=(60,), lradius=(90,)),
            amc_frame(2, lfemur=(0, 0, -20), rradius=(90,), lhumerus=(0, 0, 70)),
        ]
        motion = read_asf_amc(write_clip(tmp_path, frames))
        assert self.limb(motion, "left_hip")[2] == pytest.approx(1.0, abs=0.01)
        assert self.limb(motion, "right_knee")[2] < -0.8  # the shin goes back
        assert self.limb(motion, "left_elbow")[2] > 0.8  # the forearm comes forward
        assert self.limb(motion, "right_elbow", 1)[2] > 0.8
        np.testing.assert_allclose(self.limb(motion, "left_hip", 1), [0, -1, 0], atol=1e-9)
        # An elbow is a hinge about one axis of ours: the mesh's own.
        elbow = motion.poses[0, JOINT["left_elbow"]]
        assert elbow[1] < 0 and abs(elbow[1]) > 5 * max(abs(elbow[0]), abs(elbow[2]))

    def test_root_path_is_scaled_to_our_legs(self, tmp_path):
        frames = [amc_frame(1), amc_frame(2, root=(0, 0, 10, 0, 0, 0))]
        motion = read_asf_amc(write_clip(tmp_path, frames))
        step = motion.translations[1] - motion.translations[0]
        np.testing.assert_allclose(step, [0, 0, 10 * METRES * 0.81 / (14.4 * METRES)], atol=1e-12)
        assert motion.fps == CMU_RATE

    def test_hands_are_damped(self, tmp_path):
        motion = read_asf_amc(write_clip(tmp_path, [amc_frame(1, lhand=(50,))]))
        assert np.linalg.norm(motion.poses[0, JOINT["left_wrist"]]) == pytest.approx(np.radians(5))


class TestGlitches:
    def test_a_spike_is_bridged_and_named(self, tmp_path):
        angles = np.linspace(0, 30, 61)
        angles[30] = 150
        frames = [amc_frame(k + 1, rradius=(a,)) for k, a in enumerate(angles)]
        motion = read_asf_amc(write_clip(tmp_path, frames))
        assert "rradius in frames 28-34" in motion.source
        turned = np.linalg.norm(motion.poses[:, JOINT["right_elbow"]], axis=1)
        np.testing.assert_allclose(np.degrees(turned), np.linspace(0, 30, 61), atol=1e-6)

    def test_fast_but_human_turning_is_left_alone(self):
        time = np.arange(120) / CMU_RATE
        turned = rotation_matrices(np.outer(0.5 * np.sin(40 * time), [0, 1, 0]))  # 20 rad/s
        copy = turned.copy()
        assert repair(turned, CMU_RATE) == []
        np.testing.assert_array_equal(turned, copy)

    @pytest.mark.parametrize("at", [0, 1, 58, 59])
    def test_a_spike_at_an_end_is_held(self, at):
        turned = np.tile(np.eye(3), (60, 1, 1))
        turned[at] = rotation_matrices(np.array([0.0, 2.0, 0.0]))
        assert len(repair(turned, CMU_RATE)) == 1
        np.testing.assert_allclose(turned, np.tile(np.eye(3), (60, 1, 1)), atol=1e-12)
        assert 2.0 * CMU_RATE > GLITCH


GOOD = [amc_frame(1), amc_frame(2)]


class TestBrokenFiles:
    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (lambda text: "", "empty"),
            (lambda text: ":DEGREES\n", "no frame"),
            (lambda text: text.replace("head 0.0", "head zero", 1), "line 6.*numbers"),
            (lambda text: text.replace("head 0.0", "head nan", 1), "line 6.*infinite"),
            (lambda text: text.replace("head 0.0", "head 0.0 1.0", 1), "line 6.*2 numbers"),
            (lambda text: text.replace("head", "tail", 1), "line 6.*unknown bone 'tail'"),
            (lambda text: text.replace("head 0.0\n", "", 1), "frame 1 ends without bone 'head'"),
            (lambda text: text[: len(text) * 3 // 4].rsplit("\n", 1)[0], "cut off"),
            (lambda text: "head 0.0\n" + text, "line 1.*before the first frame"),
        ],
    )
    def test_clip(self, tmp_path, change, words):
        clip = write_clip(tmp_path, GOOD)
        clip.write_text(change(clip.read_text()))
        with pytest.raises(MotionError, match=words) as caught:
            load_motions(clip)
        self.check_line(caught, "07_01.amc")

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (lambda text: "", "empty"),
            (lambda text: "solid cube\n" + text, "line 1.*is it an .asf file"),
            (lambda text: text.replace(":hierarchy", ":anarchy"), ":hierarchy is missing"),
            (lambda text: text.replace("name lfemur", "name left_thigh"), "'lfemur' has no entry"),
            (lambda text: text.replace("femur", "thigh"), "unknown bone 'lfemur'|no bone 'lfemur'"),
            (lambda text: text.replace("length 7.0", "length long", 1), "line .*numbers"),
            (lambda text: text.replace("direction 0 1 0", "direction 0 0 0", 1), "direction cannot be zero"),
            (lambda text: text.replace("dof rx ry rz", "dof rx ry rz l", 1), "channel 'l'"),
            (lambda text: text.replace("0.0 XYZ", "0.0 XXZ", 1), "permutation"),
            (lambda text: text.replace("length 0.45", "length 0", 1), "positive"),
        ],
    )
    def test_skeleton(self, tmp_path, change, words):
        clip = write_clip(tmp_path, GOOD, skeleton=change(cmu_like()) or " ")
        with pytest.raises(MotionError, match=words) as caught:
            load_motions(clip)
        self.check_line(caught, "07")

    def test_missing_skeleton_file_folder_and_kind(self, tmp_path):
        clip = write_clip(tmp_path, GOOD)
        (tmp_path / "07.asf").unlink()
        notes, empty = tmp_path / "notes.txt", tmp_path / "empty"
        notes.write_text("hello")
        empty.mkdir()
        for path, words in (
            (clip, "skeleton 07.asf is missing"),
            (tmp_path / "none.amc", "no such file"),
            (notes, "unknown kind"),
            (empty, "holds no"),
        ):
            with pytest.raises(MotionError, match=words) as caught:
                load_motions(path)
            self.check_line(caught, path.name)

    @pytest.mark.parametrize(
        ("arrays", "words"),
        [
            ({"trans": np.zeros((3, 3)), "mocap_framerate": 30}, "no array 'poses'"),
            ({"poses": np.zeros((3, 72)), "trans": np.zeros((3, 3))}, "no frame rate"),
            ({"poses": np.zeros((3, 70)), "trans": np.zeros((3, 3)), "mocap_framerate": 30}, "shape"),
            (
                {"poses": np.zeros((3, 72)), "trans": np.zeros((4, 3)), "mocap_framerate": 30},
                "'trans' has shape",
            ),
            (
                {"poses": np.full((3, 72), np.nan), "trans": np.zeros((3, 3)), "mocap_framerate": 30},
                "frame 0",
            ),
            ({"poses": np.zeros((3, 72)), "trans": np.zeros((3, 3)), "mocap_framerate": 0}, "positive"),
            ({"poses": np.full((3, 72), "a"), "trans": np.zeros((3, 3)), "mocap_framerate": 30}, "numbers"),
        ],
    )
    def test_amass(self, tmp_path, arrays, words):
        path = tmp_path / "clip.npz"
        np.savez(path, **arrays)
        with pytest.raises(MotionError, match=words) as caught:
            load_motions(path)
        self.check_line(caught, "clip.npz")

    @pytest.mark.parametrize("content", [b"", b"not a zip file at all", b"PK\x03\x04 broken"])
    def test_damaged_amass(self, tmp_path, content):
        path = tmp_path / "clip.npz"
        path.write_bytes(content)
        with pytest.raises(MotionError, match="readable"):
            load_motions(path)

    @staticmethod
    def check_line(caught, name):
        message = str(caught.value)
        assert "\n" not in message and name in message


@pytest.mark.parametrize("columns", [72, 156, 165])
def test_amass_is_turned_upright_and_placed(tmp_path, columns):
    frames, fps = 121, 120.0
    poses = np.zeros((frames, columns))
    # Upright in a z-up world is a quarter turn about x; this person then faces +x there.
    upright = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_euler("x", 90, degrees=True)
    poses[:, :3] = upright.as_rotvec()
    poses[:, 3 * JOINT["left_elbow"] + 1] = -0.7
    poses[:, 3 * 21 : 3 * 22] = [0.5, 0.0, 0.0]
    rise = np.linspace(0.0, 0.3, frames)
    np.savez(
        tmp_path / "clip.npz",
        poses=poses,
        trans=np.stack((2.0 * rise, np.full(frames, 9.0), rise), axis=1),
        mocap_framerate=fps,
        gender="neutral",
    )
    (motion,) = load_motions(tmp_path / "clip.npz", spread_degrees=0.0)
    assert (motion.name, motion.frames, motion.fps, motion.kind) == ("clip", 31, 30.0, "recorded")
    np.testing.assert_allclose(motion.poses[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(
        motion.poses[:, JOINT["left_elbow"]], np.tile([0, -0.7, 0], (31, 1)), atol=1e-12
    )
    np.testing.assert_allclose(motion.poses[:, JOINT["right_wrist"], 0], 0.05)
    # Forward along its own heading is +z, up is +y.
    travelled = motion.translations[-1] - motion.translations[0]
    np.testing.assert_allclose(travelled, [0, 0.3, 0.6], atol=1e-9)


@pytest.mark.skipif(not CLIPS.is_dir(), reason="no CMU clips here; set CMU_MOTIONS to a folder of them")
class TestRecordedClips:
    @pytest.mark.parametrize("largest", [0.5e6, pytest.param(1e9, marks=pytest.mark.slow)])
    def test_every_clip_becomes_a_motion(self, tmp_path, largest):
        chosen = [p for p in CLIPS.iterdir() if p.suffix == ".asf" or p.stat().st_size < largest]
        for path in chosen:
            (tmp_path / path.name).symlink_to(path.resolve())
        motions = {motion.name: motion for motion in load_motions(tmp_path)}
        assert len(motions) == sum(path.suffix == ".amc" for path in chosen)
        for motion in motions.values():
            assert motion.fps == 30.0
            lowest = sole_points(motion.poses, motion.translations)[..., 1].min(axis=1)
            assert lowest.min() > -0.06  # single frames below the recorded floor
            assert rotation_matrices(motion.poses[0, 0])[2, 2] > 0.9
        if "02_01" in motions:
            walk = motions["02_01"]
            travelled = walk.translations[-1] - walk.translations[0]
            # It walks where it looks, at a walker's pace.
            assert 0.9 < travelled[2] / walk.duration < 1.6
            assert abs(travelled[0]) < 0.2 * travelled[2]

    @pytest.mark.parametrize("name", ["02_01", "02_03"])
    def test_limbs_of_our_body_point_where_the_recorded_ones_do(self, name):
        # Oracle: plain forward kinematics of the file with extrinsic Euler angles, bone by bone.
        if not (CLIPS / f"{name}.amc").is_file():
            pytest.skip(f"clip {name} is not in the folder")
        skeleton = read_asf(CLIPS / f"{name[:2]}.asf")
        channels = read_amc(CLIPS / f"{name}.amc", skeleton)
        turned = {}
        for bone in skeleton.bones.values():
            order = [c for c in bone.channels if c.startswith("r")]
            columns = [bone.channels.index(c) for c in order]
            turn = Rotation.identity(len(channels["root"]))
            if order:
                turn = Rotation.from_euler("".join(c[1] for c in order), channels[bone.name][:, columns])
            own = Rotation.from_matrix(bone.axes)
            turned[bone.name] = (
                (turned[bone.parent] if bone.parent else Rotation.identity()) * own * turn * own.inv()
            )
        motion = read_asf_amc(CLIPS / f"{name}.amc")
        positions = joint_positions(motion.poses, motion.translations, Body.load().joints())
        for near, far in LIMBS.items():
            limb = positions[:, JOINT[far]] - positions[:, JOINT[near]]
            limb /= np.linalg.norm(limb, axis=1, keepdims=True)
            recorded = turned[JOINT_BONES[near]].apply(skeleton.bones[JOINT_BONES[near]].direction)
            error = np.degrees(np.arccos(np.clip((limb * recorded).sum(axis=1), -1, 1)))
            assert error.mean() < 2.0, near
