"""Windows of a training set and the statistics of its inputs."""

from dataclasses import replace

import numpy as np

from snug.body.skeleton import JOINT
from snug.motion.motion import Motion
from snug.training.training_set import TrainingSet
from tests.snug.training.dressing import PLAIN, make_trainer, swaying, tube_dress


def test_windows_stay_within_a_motion_and_all_come_by():
    clips = [swaying(9, name="a"), swaying(7, name="b")]
    trainer = make_trainer(replace(PLAIN, batch=4), motions=clips)
    starts = set()
    for _ in range(3):
        frames = trainer.data.batch(trainer.draw(), None).frames
        assert ((frames < 9).all(axis=1) | (frames >= 9).all(axis=1)).all()
        starts |= set(frames[:, 0].tolist())
    assert starts == {*range(7), *range(9, 14)}
    assert trainer.data.where(9 + 3) == "motion 'b' frame 3"
    disjoint = TrainingSet(
        tube_dress(), clips, replace(PLAIN, window_stride=3), features="motion", sequences=True
    )
    assert disjoint.starts.tolist() == [0, 3, 6, 9, 12]
    single = TrainingSet(
        tube_dress(), clips, replace(PLAIN, window_stride=3), features="pose", sequences=False
    )
    assert single.starts.tolist() == list(range(16))  # a network of one frame learns from every frame


def test_a_neck_that_hardly_moved_in_training_does_not_drown_the_other_inputs_when_it_bends():
    trained, bent = swaying(30), np.zeros((1, 24, 3))
    trained.poses[:, JOINT["neck"], 0] += np.deg2rad(np.linspace(-2.0, 2.0, 30))
    bent[:, JOINT["neck"], 0] = np.deg2rad(40.0)
    dressed = tube_dress()
    mean, std = TrainingSet(
        dressed, [trained], PLAIN, features="pose", sequences=False
    ).input_statistics()
    unseen = dressed.features(Motion("bent", bent, np.zeros((1, 3))), PLAIN, feature_set="pose").numpy()
    assert np.abs((unseen - mean) / std).max() < 4.0


def test_only_inputs_that_hold_a_shape_are_normalised_by_its_range():
    shaped = replace(PLAIN, shape_range=3.0)
    dressed, clips = tube_dress(), [swaying(30)]
    pose = TrainingSet(dressed, clips, shaped, features="pose", sequences=False)
    assert np.array_equal(pose.input_statistics()[0], pose.features.mean(0).numpy())
    motion = TrainingSet(dressed, clips, shaped, features="motion", sequences=True)
    assert np.allclose(motion.input_statistics()[1][-10:], np.sqrt(3.0))
