"""Nearest poses and ridge on principal components: known answers, and their way through training and file."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from snug.body.skinning import skin, unskin_damped
from snug.kinds import KINDS
from snug.networks.fitted import COMPONENTS, NEIGHBOURS, NearestPoses, PoseRegression
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel
from tests.snug.training.dressing import short, stand_in, swaying, tube_dress

FITTED = ("nearest-poses", "pose-regression")


def frames(count: int, inputs: int = 6, vertices: int = 5) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(count)
    poses = 0.3 + torch.randn(count, inputs, generator=generator)
    return poses, 0.1 * torch.randn(count, vertices, 3, generator=generator)


def test_a_training_pose_has_its_own_offsets_and_a_pose_between_two_is_shared():
    poses, offsets = frames(50)
    network = NearestPoses(6, 5)
    network.learn(poses, offsets)
    assert torch.allclose(network(poses[:, None])[0][:, 0], offsets, atol=1e-6)
    far = poses + 100.0 * torch.arange(50.0)[:, None]
    network.learn(far, offsets)
    between = (
        0.75 * far[7] + 0.25 * far[8]
    )  # nine times as much of 7 as of 8; the next are further by far
    others = [1 / float((between - far[i]).square().sum()) for i in (7, 8, 6, 9)]
    expected = sum(w * offsets[i] for w, i in zip(others, (7, 8, 6, 9))) / sum(others)
    assert NEIGHBOURS == 4 and torch.allclose(network(between[None, None])[0][0, 0], expected, atol=1e-6)
    assert others[0] / others[1] == pytest.approx(9.0, rel=0.05)


def test_the_regression_is_ridge_by_another_road():
    """Rows of the penalty appended to the inputs, and an exact decomposition of steeply falling offsets."""
    poses, offsets = frames(300, inputs=12, vertices=40)
    scale = torch.logspace(0, -6, 120).reshape(40, 3)
    network, ridge = PoseRegression(12, 40), 0.3
    network.learn(poses, offsets * scale, ridge=ridge)
    x, y = poses.double().numpy(), (offsets * scale).flatten(1).double().numpy()
    x_centred, y_centred = x - x.mean(0), y - y.mean(0)
    directions = np.linalg.svd(y_centred, full_matrices=False)[2][:COMPONENTS]
    stacked = np.concatenate([x_centred, np.sqrt(ridge * len(x)) * np.eye(12)])
    target = np.concatenate([y_centred @ directions.T, np.zeros((12, COMPONENTS))])
    weights = np.linalg.lstsq(stacked, target, rcond=None)[0]
    expected = y.mean(0) + x_centred @ weights @ directions
    prediction = network(poses[:, None])[0][:, 0].flatten(1).detach().numpy()
    assert np.abs(prediction - expected).max() < 1e-3 * np.abs(expected - y.mean(0)).max()


def test_damped_offsets_are_those_of_skin_but_where_a_blend_is_nearly_singular():
    dressed, motion = tube_dress(), swaying(6)
    weights, transforms = dressed.weights(20), dressed.transforms(motion.poses)
    offsets = 0.05 * torch.sin(40 * dressed.rest())
    posed = skin(dressed.rest() + offsets, weights, transforms)
    estimate = unskin_damped(posed, dressed.rest(), weights, transforms, 1e-6)
    assert torch.allclose(estimate, offsets.expand_as(estimate), atol=1e-5)
    turned = torch.zeros(1, 2, 3, 4)  # two joints half a turn apart: the mean of their maps flattens
    turned[0, 0, :, :3], turned[0, 1, :, :3] = torch.eye(3), torch.diag(torch.tensor([-1.0, -1.0, 1.0]))
    half = torch.full((1, 2), 0.5)
    lying = unskin_damped(torch.tensor([[[1.0, 2.0, 3.0]]]), torch.zeros(1, 3), half, turned, 0.01)
    assert torch.allclose(lying, torch.tensor([[[0.0, 0.0, 3.0 / 1.01]]]))


@pytest.mark.parametrize("kind", FITTED)
def test_a_fitted_model_follows_its_training_motion_and_loads_as_it_was(kind, tmp_path):
    motion = swaying(40)
    model, target = short(kind, motions=[motion], recipe=KINDS[kind].recipe), stand_in(motion)
    positions = roll_out(model, tube_dress(), motion).positions
    start, share = tube_dress().skinned(motion, smoothing=20), 0.02 if kind == "nearest-poses" else 0.5
    assert np.abs(positions - target).max() < share * np.abs(start - target).max()
    # The loss is the mean squared distance [cm^2] of the roll-out from the frames.
    squared = 1e4 * ((positions - target) ** 2).sum(-1).mean()
    assert model.unit == "cm²" and model.history[0]["loss"] == pytest.approx(squared, rel=1e-2)
    assert model.summary["training_frames"] == 40
    loaded = TrainedModel.load(model.save(tmp_path / "model.safetensors"))
    again = roll_out(loaded, tube_dress(), motion).positions
    assert np.array_equal(again, positions)
    still = roll_out(loaded, tube_dress(), motion, quasi_static=True).positions
    assert np.abs(still - positions).max() < 2e-5  # it has no dynamics
