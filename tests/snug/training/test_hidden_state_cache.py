"""Training windows start from the network's latest hidden state after the preceding frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from snug.named_recipes import SUPERVISED
from snug.recipe import DEFAULT
from snug.training.optimisation_step import Trainer
from snug.training.training_set import HiddenStateCache
from tests.snug.training.dressing import swaying, tube_dress

RECIPE = replace(DEFAULT, mixed=0.0, h0_sigma=0.0)
MOTIONS = [swaying(12), swaying(9, name="slow", degrees=10.0)]


def made(recipe=RECIPE, kind="snug", steps=12):
    return Trainer(kind, tube_dress(), MOTIONS, steps=steps, seed=0, recipe=recipe)


def test_a_frame_is_given_what_was_kept_after_the_one_before():
    memory = HiddenStateCache(np.array([0, 5, 8]), (2, 3), torch.device("cpu"))
    assert memory.at(np.array([0, 3, 5])).abs().max() == 0.0
    states = torch.arange(12.0).view(2, 2, 3) + 1.0
    memory.keep(np.array([3, 4]), states)
    assert torch.equal(memory.at(np.array([4])), states[:, :1])
    # After frame 4 comes another motion, which begins with no past.
    assert memory.at(np.array([5])).abs().max() == 0.0 and torch.equal(memory.states[:, 4], states[:, 1])


def test_with_weights_that_stand_still_what_is_remembered_becomes_a_roll_out():
    trainer = made(replace(RECIPE, learning_rate=1e-12, window=3), steps=60)
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
                        kept = trainer.hidden_states.states[:, frame]
                        assert (kept - state[:, 0]).abs().max() < 1e-5 * state.abs().max()
        assert trainer.hidden_states.states[:, first : first + 2].abs().max() == 0.0  # these end no window


def test_windows_start_from_what_is_remembered():
    trainer = made()
    assert trainer.hidden_states is not None
    trainer.hidden_states.states[:] = 0.5
    seen = []
    trainer.network.register_forward_pre_hook(lambda network, given: seen.append(given[1]))
    trainer.step(0)
    assert torch.equal(seen[0], torch.full_like(seen[0], 0.5))


def test_a_batch_that_is_left_out_is_not_remembered():
    trainer = made()
    assert trainer.hidden_states is not None
    trainer.data.features[:] = float("nan")
    trainer.step(0)
    assert trainer.guard.summary["skipped_updates"] == 1 and trainer.hidden_states.states.abs().max() == 0.0


@pytest.mark.parametrize(
    ("kind", "recipe"),
    [
        ("pbns", RECIPE),
        ("snug", replace(RECIPE, remembered=False)),
        ("supervised", replace(SUPERVISED, window=6)),
    ],
)
def test_who_has_no_past_or_wants_none_remembers_nothing(kind, recipe):
    targets = {motion.name: np.zeros((motion.frames, tube_dress().vertices, 3)) for motion in MOTIONS}
    trainer = Trainer(
        kind, tube_dress(), MOTIONS, steps=2, seed=0, recipe=recipe,
        trajectories=targets if kind == "supervised" else None,
    )  # fmt: skip
    assert trainer.hidden_states is None and np.isfinite(trainer.step(0)["loss"])


def test_nothing_is_remembered_where_each_window_has_another_body():
    assert made(replace(RECIPE, shape_range=1.0)).hidden_states is None and made().hidden_states is not None
    assert made(replace(RECIPE, shape_range=1.0, shape_of="clip", mixed=1.0)).hidden_states is not None
