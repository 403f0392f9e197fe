"""Neural Cloth Simulation: inputs at rest, branches apart, training and ONNX."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from snug.motion.motion import Motion
from snug.named_recipes import NCS
from snug.networks.garment_network import make_network
from snug.networks.ncs import DESCRIBED, LEAD, POSE_NUMBERS, RATES, joint_motion
from tests.snug.training.dressing import leaning, make_trainer, swaying, tube_dress

INPUTS = POSE_NUMBERS + len(DESCRIBED) * RATES


def held(motion: Motion, frame: int, frames: int) -> Motion:
    """The pose of one frame, kept."""
    rows = [frame] * frames
    return Motion("held", motion.poses[rows], motion.translations[rows], fps=motion.fps)


@pytest.fixture
def network():
    torch.manual_seed(0)
    network = make_network("ncs", INPUTS, 7, NCS, seed=0)
    torch.nn.init.normal_(network.offsets.weight)
    return network


def test_a_fall_without_turning_is_gravity_in_the_axes_of_each_joint():
    motion = leaning(held(swaying(), 5, 12))
    motion.translations[:, 1] -= 0.5 * 9.81 * (np.arange(12) / motion.fps) ** 2
    pose, rates = joint_motion(tube_dress().body, motion)
    rates = rates.reshape(12, len(DESCRIBED), RATES)
    down = pose[:, -3 * len(DESCRIBED) :].reshape(12, -1, 3)
    assert np.abs(np.linalg.norm(down, axis=2) - 1.0).max() < 1e-12
    assert np.abs(rates[2:, :, 9:] - 9.81 * down[2:]).max() < 1e-9 and not rates[:, :, :9].any()


def test_the_dynamic_branch_adds_nothing_where_nothing_moves(network):
    mean, std = np.random.default_rng(0).normal(size=INPUTS), np.full(INPUTS, 0.7)
    network.normalise_by(mean, std)
    features = torch.randn(2, 9, INPUTS)
    features[..., POSE_NUMBERS:] = 0.0
    code, state = network.dynamic_code(features, None)
    assert not code.any() and not state.any()
    network.eval()
    assert torch.equal(network(features)[0], network.decode(network.static_code(features)))


def test_strange_codes_teach_the_decoder_alone_and_not_by_inertia(network):
    features = torch.randn(10, 3, INPUTS)
    offsets = network(features)[0]
    assert (offsets[:2] - network.eval()(features)[0][:2]).abs().max() > 1e-6
    offsets[:2].square().sum().backward(retain_graph=True)
    learning = {
        name.partition(".")[0]
        for name, p in network.named_parameters()
        if p.grad is not None and p.grad.any()
    }
    assert learning == {"decoder", "offsets"}
    network.zero_grad()
    offsets[:2, 2].sum().backward(retain_graph=True)
    assert not any(p.grad is not None and p.grad.any() for p in network.parameters())
    offsets[2:].square().sum().backward()
    assert all(p.grad is not None and p.grad.any() for p in network.parameters() if p.ndim == 2)


def test_a_window_begins_with_the_state_that_its_lead_leaves():
    trainer = make_trainer(NCS, "ncs")
    windows = np.array([0, 4, 20])
    batch = trainer.data.batch(windows)
    state = trainer.start_state(batch.frames)
    assert not state[:, 0].any() and state.requires_grad
    for row, first in enumerate(windows[1:], 1):
        features = trainer.data.features[None, max(first - LEAD, 0) : first]
        expected = trainer.network.state_after(features)[:, 0]
        assert torch.allclose(state[:, row], expected, atol=1e-6) and expected.any()
