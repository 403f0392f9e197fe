"""Windows of a training set, the states that they start from, and the statistics of inputs."""

from dataclasses import replace

import numpy as np
import torch

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
    assert trainer.data.name_frame(9 + 3) == "motion 'b' frame 3"
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


RECIPE = replace(PLAIN, h0_sigma=0.0)
MOTIONS = [swaying(12), swaying(9, name="slow", degrees=10.0)]


def test_with_weights_that_stand_still_what_is_remembered_becomes_a_roll_out():
    trainer = make_trainer(replace(RECIPE, learning_rate=1e-12, window=3), motions=MOTIONS, steps=60)
    for number in range(60):
        trainer.step(number)
    assert trainer.hidden_states is not None
    data, network = trainer.data, trainer.network
    for first, end in zip(data.first[:-1], data.first[1:]):
        for begin in (first, first + 1, first + 2):  # of a roll-out whose frames 3, 6, 9 ... end windows
            with torch.no_grad():
                state = None
                for frame in range(begin, end):
                    _, state = network(data.features[None, frame : frame + 1], state)
                    if (frame - begin) % 3 == 2:
                        states = trainer.hidden_states.states[:, frame]
                        assert (states - state[:, 0]).abs().max() < 1e-5 * state.abs().max()
        assert (
            trainer.hidden_states.states[:, first : first + 2].abs().max() == 0.0
        )  # these end no window


def test_nothing_is_remembered_where_each_window_has_another_body():
    recipe = replace(RECIPE, shape_range=1.0)
    assert make_trainer(recipe).hidden_states is None and make_trainer(RECIPE).hidden_states is not None
    assert make_trainer(replace(recipe, shape_of="clip", mixed=1.0)).hidden_states is not None
