"""Run elsewhere, with TensorFlow: the network that SNUG's authors published dresses an exported scene.

    python authors_snug.py MODEL SCENE OUT.npz

MODEL: their folder, as models/SNUG-Tshirt of github.com/isantesteban/snug; SCENE: the folder that
benchmarks.export wrote for their garment and an SMPL body of mean shape (--garment assets/meshes/tshirt.obj
--body SMPL.pkl). The order of inputs is that of lines 75 to 94 of their run_snug.py (commit efd136a): pose
72, root velocity 3, shape 10; four states; what skins the garment and moves it out of the body.
"""

import sys
import time

import numpy as np
import tensorflow as tf

UNITS = 256  # of each of the four recurrent states

model, scene, out = sys.argv[1:]
snug = tf.saved_model.load(model)
motion, skinning = np.load(f"{scene}/motion_smpl.npz"), np.load(f"{scene}/skinning.npz")
poses, trans, fps = motion["poses"], motion["trans"], float(motion["fps"])
assert not motion["betas"].any(), "the inputs of another shape than the mean need SMPL's shape directions"
velocities = np.diff(trans, axis=0, prepend=trans[:1]) * fps
transforms = np.zeros((*skinning["transforms"].shape[:2], 4, 4))
transforms[..., :3, :], transforms[..., 3, 3] = skinning["transforms"], 1.0
transforms[..., :3, 3] -= trans[:, None]  # theirs are without the root's translation, which is an input
body = np.load(f"{scene}/obstacle.npz")
corners = np.moveaxis(body["positions"][:, body["faces"]], 2, 0)
across = np.cross(corners[1] - corners[0], corners[2] - corners[0])  # normals by area
normals = np.zeros_like(body["positions"])
for corner in body["faces"].T:
    np.add.at(normals, (slice(None), corner), across)
normals /= np.linalg.norm(normals, axis=-1, keepdims=True)

states = [tf.zeros((1, UNITS))] * 4
positions, clock = [], time.perf_counter()
for frame, pose in enumerate(poses):
    inputs = (
        pose.reshape(1, 1, 72), velocities[frame].reshape(1, 1, 3), np.zeros((1, 1, 10)), *states,
        trans[frame].reshape(1, 1, 3), np.zeros_like(normals[:1]), transforms[frame][None],
        body["positions"][frame][None], normals[frame][None],
    )  # fmt: skip
    garment, states = snug([tf.cast(array, tf.float32) for array in inputs])
    positions.append(np.asarray(garment).reshape(-1, 3))
seconds = (time.perf_counter() - clock) / len(poses)
np.savez(out, positions=np.stack(positions), fps=fps, seconds_per_frame=seconds)
