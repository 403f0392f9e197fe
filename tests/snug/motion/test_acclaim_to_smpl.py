"""Recorded motion put on the body: retargeting, jumps of a bone, and recorded clips where they are."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.parametric_body import Body
from snug.body.skeleton import (
    JOINT,
    LEG_LENGTH,
    global_rotations,
    joint_positions,
    rotation_matrices,
    sole_points,
)
from snug.motion.acclaim import read_amc, read_asf
from snug.motion.acclaim_to_smpl import CMU_RATE, JOINT_BONES, LIMBS, read_asf_amc
from snug.motion.files import load_motions, read_motion
from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions
from tests.snug.motion.cmu_clips import amc_frame, write_clip

CLIPS = Path(os.environ.get("CMU_MOTIONS", Path(__file__).parents[4] / "shared/data/cmu"))


class TestRetargeting:
    def limb(self, motion, joint, frame=0):
        positions = joint_positions(motion.poses, motion.translations)[frame]
        arm = positions[JOINT[LIMBS[joint]]] - positions[JOINT[joint]]
        return arm / np.linalg.norm(arm)

    def test_the_zero_pose_has_the_files_limb_directions(self, tmp_path):
        motion = read_asf_amc(write_clip(tmp_path, [amc_frame(1)]), MotionFileOptions())
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
        motion = read_asf_amc(write_clip(tmp_path, frames), MotionFileOptions())
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
        motion = read_asf_amc(write_clip(tmp_path, frames), MotionFileOptions())
        step = motion.translations[1] - motion.translations[0]
        np.testing.assert_allclose(step, [0, 0, 10 * LEG_LENGTH / 14.4], atol=1e-12)
        assert motion.fps == CMU_RATE

    def test_hands_are_damped(self, tmp_path):
        motion = read_motion(write_clip(tmp_path, [amc_frame(1, lhand=(50,))]), MotionFileOptions())
        assert np.linalg.norm(motion.poses[0, JOINT["left_wrist"]]) == pytest.approx(np.radians(5))


def test_a_spike_of_a_bone_is_bridged_and_named(tmp_path):
    angles = np.linspace(0, 30, 61)
    angles[30] = 150
    clip = write_clip(tmp_path, [amc_frame(k + 1, rradius=(a,)) for k, a in enumerate(angles)])
    with pytest.raises(MotionError, match="right_elbow jumps in frames 28-32; give --repair"):
        read_motion(clip, MotionFileOptions())
    motion = read_motion(clip, MotionFileOptions(repair=True))
    assert "repaired: right_elbow jumps in frames 28-32" in motion.source
    turned = np.linalg.norm(motion.poses[:, JOINT["right_elbow"]], axis=1)
    np.testing.assert_allclose(np.degrees(turned), np.linspace(0, 30, 61), atol=1e-6)


@pytest.mark.skipif(not CLIPS.is_dir(), reason="no CMU clips here; set CMU_MOTIONS to a folder of them")
class TestRecordedClips:
    @pytest.mark.parametrize("largest", [0.5e6, pytest.param(1e9, marks=pytest.mark.slow)])
    def test_every_clip_becomes_a_motion(self, tmp_path, largest):
        clips = sorted(CLIPS.glob("*.amc"))
        chosen = [*CLIPS.glob("*.asf"), *(path for path in clips if path.stat().st_size < largest)]
        for path in chosen:
            (tmp_path / path.name).symlink_to(path.resolve())
        motions = {
            motion.name: motion for motion in load_motions(tmp_path, options=MotionFileOptions(repair=True))
        }
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
            axes = Rotation.from_matrix(bone.axes)
            turned[bone.name] = (
                (turned[bone.parent] if bone.parent else Rotation.identity()) * axes * turn * axes.inv()
            )
        motion = read_motion(CLIPS / f"{name}.amc", MotionFileOptions(repair=True))
        positions = joint_positions(motion.poses, motion.translations, Body.load().joints())
        for near, far in LIMBS.items():
            limb = positions[:, JOINT[far]] - positions[:, JOINT[near]]
            limb /= np.linalg.norm(limb, axis=1, keepdims=True)
            recorded = turned[JOINT_BONES[near]].apply(skeleton.bones[JOINT_BONES[near]].direction)
            error = np.degrees(np.arccos(np.clip((limb * recorded).sum(axis=1), -1, 1)))
            assert error.mean() < 2.0, near
