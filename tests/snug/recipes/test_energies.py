"""An energy that a user adds is in the training loss by one line of the simulator's registry."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch

from reference_sim import energies
from snug.recipe import TERMS, Recipe, find_energy
from snug.training.physics_loss import PhysicsLoss
from tests.snug.training.dressing import PLAIN, short, tube_dress

# What a user writes: a definition, and no derivative.
SOURCE = """
import torch

from reference_sim.energies.energy import Energy


class Tether(Energy):
    '''E = k |x - x_rest|^4 of each vertex [J], k [N/m^3].'''

    name = "tether"

    def __init__(self, cloth, *, stiffness=40.0):
        import numpy as np

        self.cloth, self.stiffness = cloth, stiffness
        self.stencils = np.arange(cloth.vertex_count)[:, None]
        self.home = cloth.rest_positions

    def element_energy(self, u):
        apart = u[..., 0, :] - torch.as_tensor(self.home).to(u)
        return self.stiffness * apart.square().sum(-1) ** 2
"""


@pytest.fixture
def tethered(tmp_path, monkeypatch):
    """A recipe with the user's term, whose file and whose line in the registry are there."""
    (tmp_path / "tether.py").write_text(SOURCE)
    monkeypatch.setattr(energies, "__path__", [*energies.__path__, str(tmp_path)])
    tether = importlib.import_module("reference_sim.energies.tether")
    monkeypatch.setattr(energies, "Tether", tether.Tether, raising=False)
    monkeypatch.setattr(energies, "__all__", [*energies.__all__, "Tether"])
    yield replace(PLAIN, name="tethered", terms=(*TERMS, "tether"))
    sys.modules.pop("reference_sim.energies.tether", None)


@pytest.mark.parametrize("kernels", [True, False])
def test_its_gradient_is_that_of_finite_differences(tethered, kernels):
    cloth = tube_dress().cloth
    loss = PhysicsLoss(cloth, replace(tethered, terms=("tether",)), dt=1 / 30, kernels=kernels)
    random = np.random.default_rng(0)
    shifts = 0.1 * random.normal(size=(2, 3, *cloth.rest_positions.shape))
    x = torch.as_tensor(cloth.rest_positions + shifts).requires_grad_()

    def values(at):
        return loss(at, torch.zeros(2, 3, 3), None)["tether"]

    assert values(x).shape == (2, 3) and torch.autograd.grad(values(x).sum(), x)[0].norm() > 0.1
    assert torch.autograd.gradcheck(values, x, atol=1e-8, rtol=1e-5, fast_mode=True)


@pytest.mark.parametrize("kernels", [True, False])
def test_training_with_it_is_by_all_terms_and_knows_its_recipe(tethered, kernels, tmp_path):
    model = short(recipe=tethered, kernels=kernels)
    last = model.history[-1]
    assert list(last)[2:9] == ["loss", *TERMS[:3], "tether", *TERMS[3:]] and last["tether"] > 0.0
    assert last["loss"] == pytest.approx(sum(last[term] for term in tethered.terms))
    assert type(model).load(model.save(tmp_path / "tethered.safetensors")).recipe == tethered


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gale", "unknown energy 'gale': use one of bending, gravity, .*spring, .*strain"),
        ("barrier", "prepared for each step"),
    ],
)
def test_what_cannot_be_trained_is_refused_in_one_line(name, message):
    with pytest.raises(ValueError, match=message) as caught:
        Recipe(terms=("strain", name))
    assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match=message):
        find_energy(name)
