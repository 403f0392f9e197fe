"""The learned baselines: what each network is made of, what teaches it, and the material of PBNS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from snug.kinds import KINDS
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import make_network
from snug.networks.roll_out import roll_out
from snug.networks.tailornet import DROPOUT, FrequencyMixture
from snug.recipe import DEFAULT
from snug.training.physics_loss import SquaredContact, spring_terms
from snug.training.simulated_data import smooth_offsets
from tests.snug.training.dressing import short, stand_in, swaying, tube_dress


@pytest.mark.parametrize("kind", ["santesteban2019", "tailornet"])
def test_a_taught_baseline_learns_its_targets(kind, narrow):
    window, motion = 4 if kind != "tailornet" else 1, swaying(24)
    recipe = replace(KINDS[kind].recipe, learning_rate=4e-3, window=window)
    model = short(kind, motions=[motion], steps=30, recipe=recipe, every=10)
    assert model.history[-1]["loss"] < 0.5 * model.history[0]["loss"]
    target, positions = stand_in(motion), roll_out(model, tube_dress(), motion).positions
    skinned = tube_dress().skin(motion, smoothing=20)
    error, start = (np.linalg.norm(x - target, axis=2).mean() for x in (positions, skinned))
    assert error < 0.5 * start


def test_sizes_are_those_of_the_papers():
    santesteban = make_network("santesteban2019", 151, 4, KINDS["santesteban2019"].recipe, seed=0)
    fit, gru = 10 * 20 + 20 + 20 * 12 + 12, 3 * (1500 * (151 + 1500) + 2 * 1500)
    assert sum(p.numel() for p in santesteban.parameters()) == fit + gru + 1500 * 12 + 12
    tailornet = make_network("tailornet", 151, 4, KINDS["tailornet"].recipe, seed=0)
    inner = 1024 * 1024 + 1024 + 1024 * 12 + 12
    assert (
        sum(p.numel() for p in tailornet.parameters()) == (151 + 1) * 1024 + (141 + 1) * 1024 + 2 * inner
    )


@pytest.mark.parametrize("shapes", [0, 3])
def test_a_body_of_fewer_shapes_has_zeros_for_the_rest(shapes):
    """Else what is read as its shape is the end of the pose."""
    dressed, motion = tube_dress(), swaying(5)
    few = replace(dressed.body, shape_directions=dressed.body.shape_directions[..., :shapes],
                  joint_directions=dressed.body.joint_directions[..., :shapes])  # fmt: skip
    betas = np.arange(1.0, 1 + shapes)
    features = DressedBody(few, dressed.garment).features(
        motion, DEFAULT, betas, feature_set="pose_shape"
    )
    whole = dressed.features(
        motion, DEFAULT, np.append(betas, np.zeros(10 - shapes)), feature_set="pose_shape"
    )
    assert torch.equal(features, whole) and features.shape == (5, 151)


def test_dropout_keeps_the_mean_and_is_absent_at_run_time():
    torch.manual_seed(0)
    network = FrequencyMixture(15, 5)
    masks = network.random_state(4000, 0.3, torch.Generator().manual_seed(0))
    assert masks.mean().item() == pytest.approx(1.0, abs=2e-3)
    assert (masks == 0).float().mean().item() == pytest.approx(DROPOUT, abs=2e-3)
    features = torch.randn(1, 1, 15)
    assert torch.equal(network(features)[0], network(features)[0]) and network(features)[1] is None
    assert not torch.equal(network(features, masks[:, :1])[0], network(features)[0])


def test_smoothing_keeps_what_is_constant_and_takes_out_what_is_rough():
    garment = tube_dress().garment
    count = len(garment.rest_positions)
    constant = np.tile([0.01, -0.02, 0.03], (2, count, 1))
    assert np.abs(smooth_offsets(constant, garment.faces) - constant).max() < 1e-12
    rough = np.random.default_rng(0).normal(size=(2, count, 3))
    assert smooth_offsets(rough, garment.faces).std() < 0.5 * rough.std()


def test_the_springs_of_pbns_by_hand():
    """One edge stretched by 1 mm, one hinge bent, one vertex 3 mm too near: each in closed form."""
    cloth = tube_dress().cloth
    x = cloth.rest_positions
    membrane, bending, gravity = spring_terms(cloth)
    assert membrane.value_and_gradient(1.01 * x)[0] == pytest.approx(
        15.0 * ((0.01 * cloth.edge_lengths) ** 2).sum()
    )
    assert np.ptp(gravity.weights) == 0.0
    assert gravity.weights.sum() == pytest.approx(0.3 * 9.81 * cloth.areas.sum())
    corners = x[cloth.hinges]
    e = corners[:, 1] - corners[:, 0]
    n0, n1 = np.cross(e, corners[:, 2] - corners[:, 0]), np.cross(corners[:, 3] - corners[:, 0], e)
    n0, n1 = (n / np.linalg.norm(n, axis=1, keepdims=True) for n in (n0, n1))
    exact = 5e-5 * ((n0 - n1) ** 2).sum()
    assert exact <= bending.value_and_gradient(x)[0] < 1.05 * exact
    contact = SquaredContact(cloth)
    contact.points = x - np.array([0.0, 1.0, 0.0])
    contact.normals = np.tile([0.0, 1.0, 0.0], (len(x), 1))
    near = x.copy()
    near[7, 1] -= 0.999
    value, gradient = contact.value_and_gradient(near)
    assert value == pytest.approx(25 * 0.003**2)
    force = np.zeros_like(x)
    force[7, 1] = 2 * 25 * 0.003
    assert np.allclose(gradient, -force, atol=1e-12)
