"""The compiled frame against torch's own modules, for every kind of network."""

import numpy as np
import pytest
import torch

from snug.kinds import KINDS
from snug.networks.garment_network import make_network
from snug.networks.roll_out import prepare_frames, roll_out
from snug.networks.trained_model import TrainedModel
from tests.snug.training.dressing import swaying, tube_dress

PINS = (3, 77)


def random_model(kind: str) -> TrainedModel:
    """Nothing in it is zero or one: weights, biases, statistics of the inputs; two vertices are held."""
    dressed, recipe = tube_dress(), KINDS[kind].recipe
    inputs = dressed.features(swaying(2), recipe, feature_set=KINDS[kind].network.feature_set).shape[1]
    network = make_network(kind, inputs, dressed.vertices, recipe, seed=0, pins=PINS)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in network.parameters():
            spread = 1.5 * parameter.shape[-1] ** -0.5 if parameter.ndim == 2 else 0.2
            parameter.copy_(spread * torch.randn(parameter.shape, generator=generator))
        network.input_mean.copy_(0.3 * torch.randn(inputs, generator=generator))
        network.input_std.copy_(0.5 + torch.rand(inputs, generator=generator))
    return TrainedModel(kind, network.eval(), recipe)


def by_torch(model: TrainedModel, motion) -> tuple[np.ndarray, np.ndarray]:
    """World vertices (T, V, 3) and offsets, of the whole motion in one call of the modules."""
    dressed = tube_dress()
    features = dressed.features(motion, model.recipe, feature_set=model.network.feature_set)
    with torch.no_grad():
        offsets = model.network(features[None])[0][0]
    posed = dressed.skin(motion, smoothing=model.recipe.smoothing, offsets=offsets)
    return posed, offsets.numpy()


@pytest.mark.parametrize("kind", KINDS)
def test_a_compiled_frame_is_the_modules_own_and_that_of_its_file(kind, tmp_path, narrow):
    model, motion = random_model(kind), swaying(8)
    expected, offsets = by_torch(model, motion)
    positions = roll_out(model, tube_dress(), motion).positions
    loaded = TrainedModel.load(model.save(tmp_path / "model.safetensors"))
    assert np.array_equal(roll_out(loaded, tube_dress(), motion).positions, positions)
    assert loaded.network.megabytes == model.network.megabytes
    size = np.abs(offsets).max()
    assert size > 0.03 and (offsets[:, PINS] == 0.0).all()
    assert np.abs(positions - expected).max() < 3e-6 * max(size, 1.0)


def test_two_roll_outs_at_once_keep_their_own_states():
    model, motion = random_model("snug"), swaying(6)
    begin = prepare_frames(model, tube_dress(), motion)
    alone = np.array(list(begin()))
    together = np.array(list(zip(begin(), begin())))
    assert np.array_equal(together[:, 0], alone) and np.array_equal(together[:, 1], alone)
    assert np.abs(alone - np.array(list(prepare_frames(None, tube_dress(), motion)()))).max() > 1e-3


def test_not_a_number_stays_so():
    model = random_model("snug")
    with torch.no_grad():
        model.network.gru.bias_hh_l1[5] = float("nan")
    run = roll_out(model, tube_dress(), swaying(2))
    assert run.status == "diverged" and "not finite" in run.reason
