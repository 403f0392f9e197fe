"""ASF and AMC files: what is read of them, and each broken file refused by name."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.motion.acclaim import read_amc, read_asf
from snug.motion.acclaim_to_smpl import local_turns, world_turns
from snug.motion.files import load_motions, read_motion
from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions
from tests.snug.motion.cmu_clips import CHAIN, METRES, amc_frame, cmu_like, write_clip


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
        degrees = read_motion(write_clip(tmp_path, frames), MotionFileOptions())
        turned = [
            amc_frame(1, lfemur=tuple(np.radians([-40, 10, 5])), root=(0, 17, 0, *np.radians([10, 20, 30])))
        ]
        clip = write_clip(tmp_path, turned, name="08_01", skeleton=cmu_like(radians=True))
        clip.write_text(clip.read_text().replace(":DEGREES", ":RADIANS"))
        np.testing.assert_allclose(read_motion(clip, MotionFileOptions()).poses, degrees.poses, atol=1e-12)


GOOD = [amc_frame(1), amc_frame(2)]


class TestBrokenFiles:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda text: "", "empty"),
            (lambda text: ":DEGREES\n", "no frame"),
            (lambda text: text.replace("head 0.0", "head zero", 1), "line 6.*numbers"),
            (lambda text: text.replace("head 0.0", "head nan", 1), "line 6.*finite numbers"),
            (lambda text: text.replace("head 0.0", "head 0.0 1.0", 1), "line 6.*2 numbers"),
            (lambda text: text.replace("head", "tail", 1), "line 6.*unknown bone 'tail'"),
            (lambda text: text.replace("head 0.0\n", "", 1), "frame 1 ends without bone 'head'"),
            (lambda text: text[: len(text) * 3 // 4].rsplit("\n", 1)[0], "cut off"),
            (lambda text: "head 0.0\n" + text, "line 1.*before the first frame"),
        ],
    )
    def test_clip(self, tmp_path, change, message):
        clip = write_clip(tmp_path, GOOD)
        clip.write_text(change(clip.read_text()))
        with pytest.raises(MotionError, match=message) as caught:
            load_motions(clip)
        self.check_line(caught, "07_01.amc")

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda text: "", "empty"),
            (lambda text: "solid cube\n" + text, "line 1.*is it an .asf file"),
            (lambda text: text.replace(":hierarchy", ":anarchy"), ":hierarchy is missing"),
            (lambda text: text.replace("name lfemur", "name left_thigh"), "'lfemur' has no entry"),
            (lambda text: text.replace("femur", "thigh"), "unknown bone 'lfemur'|no bone 'lfemur'"),
            (lambda text: text.replace("length 7.0", "length long", 1), "line .*numbers"),
            (
                lambda text: text.replace("length 7.0", "length", 1),
                "line .*1 finite numbers should be in 'length'",
            ),
            (lambda text: text.replace("direction 0 1 0", "direction 0 0 0", 1), "direction cannot be zero"),
            (lambda text: text.replace("dof rx ry rz", "dof rx ry rz l", 1), "channel 'l'"),
            (lambda text: text.replace("0.0 XYZ", "0.0 XXZ", 1), "permutation"),
            (lambda text: text.replace("length 0.45", "length 0", 1), "positive"),
            # Two names of one bone made it its own parent's parent, and reading never ended.
            (lambda text: text.replace("end\nbegin\n name ltibia", " name ltibia"), "is a 'begin' missing"),
            (lambda text: text.replace("name ltibia", "name lfemur"), "bone: 'lfemur'"),
        ],
    )
    def test_skeleton(self, tmp_path, change, message):
        clip = write_clip(tmp_path, GOOD, skeleton=change(cmu_like()) or " ")
        with pytest.raises(MotionError, match=message) as caught:
            load_motions(clip)
        self.check_line(caught, "07")

    def test_missing_skeleton_file_folder_and_kind(self, tmp_path):
        clip = write_clip(tmp_path, GOOD)
        (tmp_path / "07.asf").unlink()
        notes, empty = tmp_path / "notes.txt", tmp_path / "empty"
        notes.write_text("hello")
        empty.mkdir()
        for path, message in (
            (clip, "skeleton 07.asf is missing"),
            (tmp_path / "none.amc", "no such file"),
            (notes, "unknown kind"),
            (empty, "holds no"),
        ):
            with pytest.raises(MotionError, match=message) as caught:
                load_motions(path)
            self.check_line(caught, path.name)

    @staticmethod
    def check_line(caught, name):
        message = str(caught.value)
        assert "\n" not in message and name in message
