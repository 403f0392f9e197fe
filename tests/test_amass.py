"""AMASS files: turned upright, placed, and taken whatever their columns."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.motion_files import load_motions
from snug.skeleton import JOINT


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
