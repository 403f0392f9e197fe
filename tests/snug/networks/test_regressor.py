"""The networks: what they see does not depend on what it should not, and what they start from is known."""

from dataclasses import asdict

import numpy as np
import pytest
import torch

from snug.motion.motion import turn_about_vertical
from snug.named_recipes import PAPER
from snug.networks.regressor import Regressor
from snug.networks.santesteban2019 import FitAndWrinkles
from snug.recipe import DEFAULT, Recipe
from tests.snug.training.dressing import leaning, swaying, tube_dress


def test_paper_scale_network_has_the_papers_size():
    network = Regressor(85, 4424)
    gru = sum(p.numel() for p in network.gru.parameters())
    # 3 gates x 256 x (inputs + 256 + 2 biases), first layer on 85 inputs and three on 256.
    assert gru == 3 * 256 * (85 + 256 + 2) + 3 * 3 * 256 * (256 + 256 + 2)
    assert sum(p.numel() for p in network.offsets.parameters()) == (256 + 1) * 3 * 4424
    assert 18.0 < network.megabytes < 20.0  # the paper prints 19 MB


def test_default_inputs_know_no_heading_and_no_place():
    dressed, motion = tube_dress(), leaning(swaying())
    moved = turn_about_vertical(motion, 1.1)
    moved.translations[:] += [3.0, 0.5, -2.0]
    plain, other = (dressed.features(m, DEFAULT) for m in (motion, moved))
    assert torch.allclose(plain, other, atol=1e-6)
    literal = dressed.features(moved, PAPER) - dressed.features(motion, PAPER)
    assert literal.abs().max() > 0.5


def test_default_inputs_know_lean_speed_and_shape():
    dressed, motion = tube_dress(), swaying()
    plain = dressed.features(motion, DEFAULT)
    assert (dressed.features(leaning(motion), DEFAULT) - plain).abs().max() > 0.1
    velocity = plain[:, -13:-10]
    assert (velocity[0] == 0).all() and np.allclose(velocity[1:, 2], 1.2, atol=1e-5)
    betas = np.linspace(-1, 1, 10)
    assert np.allclose(dressed.features(motion, DEFAULT, betas)[:, -10:], betas, atol=1e-6)
    assert dressed.features(motion, PAPER, feature_set="pose").shape == (motion.frames, 72)


def test_rest_follows_the_body_shape():
    dressed = tube_dress()
    betas = np.array([0.5, 2.0, -1.0, 0, 0, 1.0, 0, 0, 0, -2.0])
    expected = dressed.garment.rest_for(dressed.body, betas)
    assert np.abs(dressed.rest(betas).numpy() - expected).max() < 1e-6
    assert np.abs(expected - dressed.garment.rest_positions).max() > 5e-3
    assert dressed.rest(np.stack([betas, -betas])).shape == (2, dressed.vertices, 3)


class SmallRegressor(Regressor):
    hidden, layers = 32, 3


@pytest.mark.parametrize(
    ("make", "frames", "state"),
    [
        (SmallRegressor, 3, True),
        (SmallRegressor, 1, True),
        (SmallRegressor, 5, False),
        (FitAndWrinkles, 4, True),  # its units fill no vector register
    ],
)
def test_closed_forms_train_as_the_modules_do(make, frames, state):
    torch.manual_seed(0)
    network = make(12, 40)
    features, factor = torch.randn(4, frames, 12), torch.randn(4, frames, 40, 3)
    start = 0.3 * torch.randn(len(network.gru.all_weights), 4, network.gru.hidden_size) if state else None
    results = []
    for closed_form in (True, False):
        network.closed_form = closed_form
        network.zero_grad()
        offsets, last = network(features, start)
        (offsets * factor).sum().backward()
        gradients = {name: p.grad.clone() for name, p in network.named_parameters()}
        results.append((offsets.detach(), None if last is None else last.detach(), gradients))
    (a, a_last, a_gradients), (b, b_last, b_gradients) = results
    assert torch.allclose(a, b, atol=1e-6)
    assert last is None or torch.allclose(a_last, b_last, atol=1e-6)
    for name, gradient in b_gradients.items():
        assert gradient.norm() > 1e-3, name
        assert (a_gradients[name] - gradient).norm() < 1e-5 * gradient.norm(), name


def test_closed_forms_hide_no_window_that_is_no_number():
    torch.manual_seed(0)
    network = SmallRegressor(12, 40)
    network.closed_form = True
    features = 50.0 * torch.randn(4, 3, 12)  # far beyond where a gate is open or closed
    features[2, 1, 5] = torch.nan
    offsets, _ = network(features)
    assert offsets[2, 1:].isnan().all() and offsets[[0, 1, 3]].isfinite().all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pose_input": "quaternion"}, "pose_input='quaternion'"),
        ({"momentum": 0.9}, "'momentum' is unknown or missing"),
        ({"physics_weight": -1.0}, "physics_weight=-1.0: must be at least 0"),
    ],
)
def test_recipe_refuses_nonsense(options, message):
    with pytest.raises(ValueError, match=message):
        Recipe.from_dict(asdict(DEFAULT) | options)
