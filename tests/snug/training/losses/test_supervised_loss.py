"""Distance from simulated vertices and energies in one loss."""

from dataclasses import asdict, replace

import numpy as np
import pytest
import torch

from benchmarks.provenance import digest
from snug.body.skinning import skin
from snug.named_recipes import SUPERVISED, SUPERVISED_VERTICES
from snug.recipe import DEFAULT, Recipe
from tests.snug.training.dressing import make_trainer, planes_of, short, stand_in, swaying

HELD = swaying(20, name="held", degrees=15.0)
SIMULATED = {motion.name: stand_in(motion) for motion in (swaying(30), HELD)}
# The tube hangs 3 cm and more off the body; first states are zero.
WEIGHED = replace(
    SUPERVISED, physics_weight=3.0, contact_margin=0.05, zero_last_layer=False, h0_sigma=0.0
)


def test_a_step_descends_by_the_distance_and_lambda_times_the_energies():
    """Its gradient is automatic differentiation's of the definitions; its terms are in cm^2 and J."""
    trainer = make_trainer(WEIGHED, "supervised", trajectories=SIMULATED)
    windows = np.arange(6)
    trainer.draw, trainer.optimiser.step = lambda: windows, lambda: None
    means, batch = trainer.step(0), trainer.data.batch(windows, None)
    gradients = [p.grad.clone() for p in trainer.network.parameters()]
    trainer.network.closed_form = False
    x = skin(trainer.network(batch.features)[0] + batch.rest, trainer.weights, batch.transforms)
    rows, *body = trainer.contact.bodies.pose(batch)
    planes = planes_of(trainer.contact.cache, batch.frames.ravel(), rows.ravel(), *body)
    points, normals = (torch.as_tensor(a).view(*x.shape[:2], -1, 3) for a in planes)
    terms = {
        "vertices": 1e4 * ((x - trainer.targets.vertices[batch.frames]) ** 2).sum(-1).mean(-1).double(),
        "strain": trainer.loss.static["strain"].energy(x.double()).sum(-1),
        "collision": trainer.loss.contact.energy(x.double(), points, normals).sum(-1),
    }
    loss = (terms["vertices"] + 3.0 * (terms["strain"] + terms["collision"])).mean()
    for name, term in {"loss": loss, **terms}.items():
        assert means[name] == pytest.approx(term.mean().item(), rel=1e-3) and means[name] > 1e-3
    for one, other in zip(gradients, torch.autograd.grad(loss, list(trainer.network.parameters()))):
        assert other.norm() > 0 and (one - other).norm() < 2e-3 * other.norm()


def test_without_lambda_training_files_and_digests_are_those_on_vertices_alone():
    recipes = SUPERVISED_VERTICES, replace(SUPERVISED, physics_weight=0.0)
    plain, none = (short("supervised", recipe=recipe).network.state_dict() for recipe in recipes)
    assert all(torch.equal(plain[name], none[name]) for name in plain)
    added = ("physics_weight", "turn")
    older = {name: value for name, value in asdict(DEFAULT).items() if name not in added}
    assert Recipe.from_dict(older) == DEFAULT and digest(DEFAULT) == digest(older) != digest(SUPERVISED)
