"""Bad batches are named, their updates left out, and lost weights come back."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from snug.training import contact_planes, divergence_guard, optimisation_step
from snug.training.divergence_guard import PATIENCE, SETTLING
from snug.training.train_network import TrainingLoop
from snug.training.training_set import TrainingError
from tests.snug.training.dressing import PLAIN, make_trainer


def test_guard_counts_high_windows_and_clips(monkeypatch):
    monkeypatch.setattr(optimisation_step, "GRADIENT_LIMIT", 1e-3)
    recipe = replace(PLAIN, spike=1e-6)
    trainer = make_trainer(recipe)
    trainer.step(0)
    assert trainer.guard.summary["high_windows"] == 0  # the first steps are not judged
    trainer.step(60)
    assert trainer.guard.summary["high_windows"] == 16
    norms = [p.grad.norm() for p in trainer.network.parameters()]
    assert torch.stack(norms).norm() == pytest.approx(1e-3, rel=1e-2)


def test_training_gives_up_with_a_reason():
    trainer = make_trainer(steps=200)
    trainer.data.features[:] = float("nan")
    with pytest.raises(TrainingError, match=r"diverged.*motion 'sway' frame"):
        TrainingLoop(trainer, every=10).run()


def weights_of(trainer):
    return torch.cat([p.detach().flatten() for p in trainer.network.parameters()])


def test_lost_weights_come_back(monkeypatch):
    """A gradient that is not finite ruins the weights, and with them every later batch."""
    monkeypatch.setattr(divergence_guard, "SNAPSHOT_EVERY", 20)
    trainer = make_trainer()
    for number in range(23):
        trainer.step(number)
    before = weights_of(trainer)
    with torch.no_grad():
        trainer.network.offsets.bias[7] = float("nan")
    losses = [trainer.step(23 + k)["loss"] for k in range(PATIENCE + 2)]
    assert not np.isfinite(losses[:PATIENCE]).any() and np.isfinite(losses[PATIENCE:]).all()
    summary = trainer.guard.summary
    assert summary["restored"] == 1 and summary["skipped_updates"] == PATIENCE
    assert summary["named_windows"][-1]["action"] == "weights of step 20 restored, rate halved"
    assert "motion 'sway' frame" in summary["named_windows"][-1]["window"]
    assert trainer.guard.rate == 0.5
    assert (weights_of(trainer) - before).abs().max() < 0.02  # a few steps of 1e-3, and as many back


def test_a_gradient_that_is_not_finite_is_not_followed():
    """Its energies are fine, so nothing else would tell."""
    trainer = make_trainer()
    for number in range(3):
        trainer.step(number)
    before = weights_of(trainer)
    spoilt = trainer.network.offsets.weight.register_hook(lambda gradient: gradient * float("nan"))
    assert np.isfinite(trainer.step(3)["loss"])
    spoilt.remove()
    assert torch.equal(weights_of(trainer), before)
    (named,) = trainer.guard.summary["named_windows"]
    assert named["action"] == "gradient not finite, update left out" and named["step"] == 3
    assert "motion 'sway' frame" in named["window"] and trainer.guard.summary["skipped_updates"] == 1
    trainer.step(4)
    assert not torch.equal(weights_of(trainer), before) and torch.isfinite(weights_of(trainer)).all()


def test_runaway_energy_brings_good_weights_back():
    trainer = make_trainer()
    for number in range(SETTLING + 1):
        usual = trainer.step(number)["loss"]
    with torch.no_grad():  # finite, but centimetres of noise
        trainer.network.offsets.weight.normal_(0, 0.3, generator=torch.Generator().manual_seed(0))
    losses = [trainer.step(SETTLING + 1 + k)["loss"] for k in range(PATIENCE + 1)]
    assert min(losses[:PATIENCE]) > 10 * usual and losses[PATIENCE] < 3 * usual  # step 0
    assert trainer.guard.summary["restored"] == 1 and trainer.guard.summary["skipped_updates"] == 1


@pytest.mark.parametrize("usual", [0.4, 0.01, -0.01, -0.8])
def test_an_energy_around_zero_makes_no_runaway_of_one_high_window(usual):
    """Trousers hang below the pelvis, where their height, and with it their energy, is negative."""
    guard = make_trainer().guard
    batch = np.full(16, usual)
    for number in range(SETTLING + 1):
        assert guard.judge(number, batch, str) == "update"
    batch[0] = 2.1
    verdicts = [guard.judge(SETTLING + 1 + k, batch, str) for k in range(2 * PATIENCE)]
    assert set(verdicts) == {"clip"} and guard.rate == 1.0
    assert guard.judge(SETTLING + 9, np.full(16, 20.0), str) == "distrust"


def test_a_high_window_has_its_anchors_searched_before_it_is_judged(monkeypatch):
    """Anchors from the wrong side of the body claim a contact that is none."""
    monkeypatch.setattr(contact_planes, "REFRESH", 0.0)
    recipe = replace(PLAIN, batch=8)
    trainer = make_trainer(recipe)
    row = trainer.step(SETTLING)
    usual = row["collision"]
    anchors = trainer.contact.cache
    searched, whole = [], anchors.requery

    def requery(frame, *rest, **how):
        assert how["exact"], "the anchors of a high window are no guide"
        searched.append(frame)
        whole(frame, *rest, **how)

    monkeypatch.setattr(anchors, "requery", requery)
    # Every anchor of the next batch's first window on the far side of the trunk.
    order = trainer.order.copy()
    frames = trainer.data.starts[order[0]] + np.arange(3)
    anchors.faces[frames] = anchors.faces[frames][:, ::-1]
    row = trainer.step(SETTLING + 1)
    assert set(frames) <= set(searched) and len(searched) <= 6
    assert row["collision"] < usual + 0.05 and trainer.guard.summary["high_windows"] == 0
    # A lost network is no guide: nothing is searched where most windows are high.
    searched.clear()
    trainer.network.offsets.bias.data.normal_(0, 0.3)
    trainer.step(SETTLING + 2)
    assert not searched
