"""Energies of a small training, kept: a changed weight, start or term of the loss shows in them.

After a wanted change print `trained()` and keep what it gives.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from snug.recipe import DEFAULT
from snug.training import physics_loss
from snug.training.optimisation_step import Trainer
from tests.snug.training.dressing import swaying, tube_dress

STEPS, LAST = 40, 10
RECIPE = replace(DEFAULT, learning_rate=2e-3, zero_last_layer=False, mixed=0.0)
# J a frame, mean of the last ten of forty steps
KEPT = {"strain": 0.1575, "bending": 0.000503, "gravity": 0.1377, "inertia": 0.000791}
TOLERANCE = 0.03  # processors round differently; the planted faults are farther off


def trained() -> dict[str, float]:
    motions = [swaying(36, degrees=40.0)]
    trainer = Trainer("snug", tube_dress(), motions, steps=STEPS, seed=0, recipe=RECIPE)
    means = [trainer.step(number) for number in range(STEPS)][-LAST:]
    return {name: float(np.mean([mean[name] for mean in means])) for name in KEPT}


def test_a_small_training_reaches_the_energies_that_are_kept():
    assert trained() == pytest.approx(KEPT, rel=TOLERANCE)


def test_inertia_at_a_third_is_noticed(monkeypatch):
    plain = physics_loss.batch_of_windows
    monkeypatch.setattr(
        physics_loss,
        "batch_of_windows",
        lambda term, ahead, windows, weight: plain(term, ahead, windows, weight / 3),
    )
    assert trained()["inertia"] != pytest.approx(KEPT["inertia"], rel=TOLERANCE)
