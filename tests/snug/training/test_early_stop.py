"""Early stop by motions held out of training."""

from dataclasses import replace

import pytest
import torch

from reference_sim import Obstacle, Potential
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, Inertia, Step, StretchStVK
from snug.named_recipes import SUPERVISED_VERTICES
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel
from snug.training.train_network import TrainingLoop
from snug.training.training_set import TrainingError
from snug.training.validation import Validation, Validator
from tests.snug.training.dressing import PLAIN, make_trainer, short, swaying, tube_dress

HELD = swaying(20, name="held", degrees=30.0)


def test_value_is_the_energy_of_the_roll_out():
    """Computed again by the simulator's own energies and its own search of the closest skin."""
    made, dressed = make_trainer(), tube_dress()
    for number in range(30):
        made.step(number)
    value = Validator(made, Validation(motions=[HELD])).value()
    x = roll_out(TrainedModel("snug", made.network, PLAIN), dressed, HELD).positions
    body = Obstacle(dressed.body.vertices(HELD.poses, HELD.translations), dressed.body.faces)
    terms = [E(dressed.cloth) for E in (StretchStVK, BendHinge, Gravity, ContactPenalty)]
    potential = Potential([*terms, Inertia(dressed.cloth, 1 / 30)])
    # Heights count from the pelvis.
    total = -9.81 * dressed.cloth.masses.sum() * dressed.pelvis(HELD)[:, 1].sum()
    for t in range(HELD.frames):
        before, last = x[max(t - 1, 0)], x[max(t - 2, 0)]
        potential.prepare(Step(before, 30 * (before - last), x[t], 1 / 30, body, t))
        energies = potential.terms(x[t])
        total += sum(energies.values()) - (energies["inertia"] if t < 2 else 0.0)
    # float32, and contact planes along the skin's normal instead of towards the closest point.
    assert value == pytest.approx(total / HELD.frames, rel=1e-3)


def test_best_weights_are_kept_and_patience_ends_training():
    made = make_trainer(steps=60)
    run = TrainingLoop(made, every=4, validation=Validation(motions=[HELD], every=4, patience=3))
    values = iter([5.0, 3.0, 4.0, 3.0, 3.5, 1.0, 1.0, 1.0])
    kept = []

    def value():
        kept.append(made.network.offsets.bias.detach().clone())
        return next(values)

    run.validator.value = value
    model = run.run()
    # Best at the second validation; three without a better one end it at the fifth.
    assert model.steps == 20 and [row["validation"] for row in model.history] == [5.0, 3.0, 4.0, 3.0, 3.5]
    validation = model.summary["validation"]
    assert (validation["best"], validation["best_step"], validation["stopped_at"]) == (3.0, 8, 20)
    assert torch.equal(model.network.offsets.bias, kept[1]) and not torch.equal(kept[1], kept[4])


def test_supervised_validates_against_its_own_targets():
    trajectories = {"sway": tube_dress().skinned(swaying(30), smoothing=20)}
    target = tube_dress().skinned(HELD, smoothing=20)
    target[..., 1] += 0.02
    validation = Validation(motions=[HELD], every=5, trajectories={"held": target})
    # Adam takes whole steps along rounding errors too.
    still = replace(SUPERVISED_VERTICES, learning_rate=1e-9)
    model = short("supervised", steps=5, recipe=still, trajectories=trajectories, validation=validation)
    # Taught to stay at skinning, where it starts, it is 2 cm off the held-out targets.
    assert model.summary["validation"]["best"] == pytest.approx(4.0, rel=1e-3)


def test_a_motion_that_trains_does_not_validate():
    with pytest.raises(TrainingError, match="'sway' cannot both"):
        Validator(make_trainer(), Validation(motions=[swaying(20)]))
