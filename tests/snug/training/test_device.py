"""The step that a GPU runs, on the CPU: torch definitions and torch contact give what the kernels give."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from reference_sim.energies import BendHinge, ContactPenalty, Gravity, StretchStVK
from reference_sim.kernels.fast_kernels import fast_kernel
from snug.kernels.contact import byte_normals
from snug.kernels.skinning import from_lanes, to_lanes
from snug.named_recipes import PAPER
from snug.training import contact_planes
from snug.training.contact_cache import ContactCache
from snug.training.contact_cache_torch import TensorContactCache
from snug.training.device import CPU
from snug.training.physics_loss import STATIC
from tests.snug.training.dressing import PLAIN, beside_skin, make_trainer, planes_of, swaying, tube_dress


@pytest.mark.parametrize(
    ("kind", "recipe"),
    [
        ("snug", PLAIN),
        ("snug", PAPER),
        ("pbns", replace(PLAIN, material="pbns", contact_samples="vertices")),
        ("snug", replace(PLAIN, material="springs")),
    ],
    ids=["default", "paper", "pbns-springs", "springs"],
)
def test_definitions_train_as_the_kernels_do(kind, recipe, monkeypatch):
    """Several steps: terms, and the gradient that the last of them left behind."""
    # No frame twice in a step: there its anchors would walk once by torch, and twice by the kernels.
    monkeypatch.setattr(contact_planes, "REFRESH", 0.0)
    recipe = replace(recipe, window_stride=3 if kind == "snug" else 1)
    fast, slow = (make_trainer(recipe, kind, motions=[swaying(144)], kernels=k) for k in (True, False))
    # the torch search finds the closest face where the walk may be rough
    tensors, facts = fast.contact.state()
    changed = torch.arange(fast.data.frames)
    anchors = fast.contact.cache
    held = {"faces": anchors.faces, "barycentric": anchors.barycentric}
    tensors |= {"changed": changed} | {key: torch.as_tensor(array.copy()) for key, array in held.items()}
    slow.contact.resume(tensors, facts)
    with torch.no_grad():  # off the template and into the skin, so that every term has something to say
        for trainer in (fast, slow):
            generator = torch.Generator().manual_seed(1)
            noise = torch.randn(trainer.network.offsets.weight.shape, generator=generator)
            trainer.network.offsets.weight += (
                0.7 if kind == "pbns" else 0.02 / recipe.output_scale
            ) * noise
    for number in range(3):
        one, other = fast.step(number), slow.step(number)
        assert one.keys() == other.keys()
        for name, value in one.items():
            # A foot on the border of two faces may be rounded to either side, and the anchor go another
            # way.
            assert other[name] == pytest.approx(value, rel=5e-5 if name in STATIC else 1e-2), name
    assert one["collision"] > 1e-4
    for name, parameter in fast.network.named_parameters():
        theirs = dict(slow.network.named_parameters())[name].grad
        assert (parameter.grad - theirs).norm() < 2e-3 * parameter.grad.norm() + 1e-9, name


@pytest.mark.parametrize("region", [0.2, 0.06])
def test_anchors_walk_to_the_closest_skin_by_torch_and_by_kernels(region):
    """From the anchors of another pose: on one smooth sheet a walk ends where a search ends, unless the
    rule of regions is so narrow that it stops the walk.
    """
    contact = ContactPenalty(tube_dress().cloth)
    patch, positions, garment = beside_skin(contact, [2, 9], region=region)
    normals = byte_normals(positions.numpy(), patch.faces)
    x = garment + torch.tensor([0.0, 0.03, -0.05])
    samples = torch.stack([torch.as_tensor(contact.sample_matrix @ y).float() for y in x.numpy()])
    frames, rows = np.array([1, 0]), np.arange(2)
    still, fast, searched = (ContactCache(patch, 2) for _ in range(3))
    slow = TensorContactCache(patch, 2, CPU)
    lanes = to_lanes(x[:, None])
    gradients, body = np.zeros_like(lanes), positions.numpy()
    on = contact, lanes, gradients, frames[:, None], rows[:, None], body, normals
    assert fast.energy(*on).sum() > 0 and (fast.faces == still.faces).all()
    fast.energy(*on, walk=True)
    chosen = torch.as_tensor(frames)
    at = torch.arange(2), positions, torch.as_tensor(normals).float()
    slow.place(chosen, slow.walk(samples, chosen, *at, reach=contact.margin))
    for row, frame in enumerate(frames):
        searched.requery(int(frame), samples[row].numpy(), positions[row].numpy(), exact=True)

    def distance(anchors):
        points, _ = planes_of(anchors, frames, rows, positions.numpy(), normals)
        return np.linalg.norm(points - samples.numpy(), axis=-1)

    moved = fast.faces[frames] != still.faces[frames]
    slow.faces, slow.barycentric = slow.faces.numpy(), slow.barycentric.numpy()
    off = {name: np.abs(distance(anchors) - distance(searched))[moved]
           for name, anchors in (("still", still), ("fast", fast), ("slow", slow))}  # fmt: skip
    assert moved.mean() > 0.1 and np.mean(off["still"] < 1e-4) < 0.2
    if region > 0.1:
        assert np.mean(off["fast"] < 1e-4) > 0.9
    assert np.mean(np.abs(off["fast"] - off["slow"]) < 1e-5) > 0.99
    for anchors in (fast, slow):
        home = np.linalg.norm(patch.sample_rest - patch.centroids[anchors.faces], axis=-1)
        assert (home[anchors.faces != still.faces] < region).all()


def lane_by_lane(kernel, x):
    """Values (N,) and gradients (N, V, 3) that a kernel of lanes gives for x (N, V, 3)."""
    lanes = to_lanes(torch.as_tensor(x)[:, None])
    gradients = np.zeros_like(lanes)
    values = kernel(lanes, gradients)
    return (from_lanes(quantity, len(x), 1)[:, 0].numpy() for quantity in (values, gradients))


@pytest.mark.parametrize("count", [16, 21])  # whole blocks of lanes, and a block that is not whole
@pytest.mark.parametrize("E", [StretchStVK, BendHinge, partial(BendHinge, rest_angles=2.5), Gravity])
def test_lanes_agree_with_the_definition(E, count):
    """Also where hinges are folded over and where a configuration is not finite."""
    dressed = tube_dress()
    energy, random = E(dressed.cloth), np.random.default_rng(count)
    crumpled = np.where(np.arange(count) % 3, 0.004, 0.05)[:, None, None]
    x = dressed.cloth.rest_positions + crumpled * random.normal(size=(count, dressed.vertices, 3))
    x = x.astype(np.float32)
    values, gradients = lane_by_lane(fast_kernel(energy, "training_batch"), x)
    for n in range(count):
        exact, slope = energy.value_and_gradient(x[n].astype(float))
        assert values[n] == pytest.approx(exact, rel=2e-5)
        assert np.linalg.norm(gradients[n] - slope) < 2e-4 * np.linalg.norm(slope)
    assert fast_kernel(ContactPenalty(dressed.cloth), "training_batch") is None
    x[-1, 3] = np.nan
    values, _ = lane_by_lane(fast_kernel(energy, "training_batch"), x)
    assert np.isnan(values[-1]) and np.isfinite(values[:-1]).all()
