"""Training windows start from the network's latest hidden state after the preceding frame."""

from __future__ import annotations

from dataclasses import replace

import torch

from snug.recipe import DEFAULT
from tests.snug.training.dressing import make_trainer, swaying

RECIPE = replace(DEFAULT, mixed=0.0, h0_sigma=0.0)
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
                        kept = trainer.hidden_states.states[:, frame]
                        assert (kept - state[:, 0]).abs().max() < 1e-5 * state.abs().max()
        assert (
            trainer.hidden_states.states[:, first : first + 2].abs().max() == 0.0
        )  # these end no window


def test_nothing_is_remembered_where_each_window_has_another_body():
    recipe = replace(RECIPE, shape_range=1.0)
    assert make_trainer(recipe).hidden_states is None and make_trainer(RECIPE).hidden_states is not None
    assert make_trainer(replace(recipe, shape_of="clip", mixed=1.0)).hidden_states is not None
