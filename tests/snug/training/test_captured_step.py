"""The step that a GPU captures, replayed on the CPU, is the step in single operations."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from snug.named_recipes import PAPER
from snug.training import captured_step, contact_planes
from snug.training.captured_step import CapturedTrainer
from snug.training.device import CudaGraph
from snug.training.divergence_guard import SETTLING
from tests.snug.training.dressing import PLAIN, make_trainer, swaying

UNCAPTURED = 1  # step in single operations; three on a GPU, which compile


class Replayed(CudaGraph):
    """A graph without a GPU: later calls write into what the first was given, and into what it returned."""

    def __call__(self, *inputs):
        if not self._inputs:
            self._inputs = tuple(tensor.clone() for tensor in inputs)
            self._outputs = self.function(*self._inputs)
            return self._outputs
        for buffer, tensor in zip(self._inputs, inputs, strict=True):
            assert (buffer.shape, buffer.dtype) == (tensor.shape, tensor.dtype)
            buffer.copy_(tensor)
        overwrite(self._outputs, self.function(*self._inputs))
        return self._outputs


def overwrite(held, new):
    if isinstance(held, torch.Tensor):
        held.detach().copy_(new.detach())
    elif isinstance(held, dict | list | tuple):
        values = (held.values(), new.values()) if isinstance(held, dict) else (held, new)
        for pair in zip(*values, strict=True):
            overwrite(*pair)


def capturing(monkeypatch, recipe, **options):
    """A trainer whose step is captured, and one that takes the same steps in single operations."""
    monkeypatch.setattr(captured_step, "UNCAPTURED", UNCAPTURED)
    options = {"motions": [swaying(48)], "kernels": False, **options}
    plain = make_trainer(recipe, **options)
    for module in ("captured_step", "contact_cache_torch"):
        monkeypatch.setattr(f"snug.training.{module}.CudaGraph", Replayed)
    captured = make_trainer(recipe, trainer=CapturedTrainer, **options)
    assert captured.capturable
    return plain, captured


def equal_states(plain, captured):
    (weights, facts), (theirs, their_facts) = plain.state(), captured.state()
    assert weights.keys() == theirs.keys() and facts.keys() == their_facts.keys()
    assert facts["random"] == their_facts["random"] and facts["contact"] == their_facts["contact"]
    assert facts["guard"] == their_facts["guard"] | {
        "usual": pytest.approx(their_facts["guard"]["usual"], rel=1e-5)
    }
    for name, tensor in weights.items():
        assert torch.allclose(tensor.double(), theirs[name].double(), rtol=1e-4, atol=1e-6), name


@pytest.mark.parametrize(("kind", "recipe"), [("snug", PLAIN), ("pbns", PAPER)])
def test_a_captured_step_is_the_step(kind, recipe, monkeypatch):
    """The replayed step gives the numbers of the step in single operations, and leaves the same behind."""
    monkeypatch.setattr(contact_planes, "REFRESH", 0.1)
    recipe = replace(recipe, window_stride=1)  # frames that come twice in a step of snug
    plain, captured = capturing(monkeypatch, recipe, kind=kind)
    places = captured.contact.cache.barycentric.clone()
    for number in range(UNCAPTURED + 2):
        expected, losses = plain.step(number), captured.step(number)
        assert losses.keys() == expected.keys()
        for name, value in expected.items():
            assert losses[name] == pytest.approx(value, rel=1e-5), (number, name)
    assert captured.captured_steps > 0
    assert (captured.contact.cache.barycentric != places).any()
    equal_states(plain, captured)


@pytest.mark.slow
@pytest.mark.parametrize("energy", [pytest.param(0.0, id="high"), pytest.param(np.nan, id="not finite")])
def test_a_batch_that_is_not_followed_is_left_to_single_operations(energy, monkeypatch):
    """A window above the limit, or without an energy: the guard sees the batch once; later steps go on."""
    plain, captured = capturing(monkeypatch, PLAIN)
    for number in range(SETTLING, SETTLING + UNCAPTURED + 3):
        odd = number == SETTLING + UNCAPTURED + 1
        for trainer in (plain, captured):
            trainer.recipe = replace(PLAIN, spike=1e-6 if odd else 1e6)
            trainer.guard.spike = trainer.recipe.spike
            trainer.loss._definitions = (
                partial(with_energy, trainer.loss._evaluate, energy) if odd else trainer.loss._evaluate
            )
        assert captured.step(number) == pytest.approx(plain.step(number), rel=1e-5, nan_ok=True)
        if odd:
            assert (
                captured.guard.summary == plain.guard.summary and plain.guard.summary["high_windows"] > 0
            )
    assert captured.captured_steps > 0
    equal_states(plain, captured)


def with_energy(definitions, energy, *arguments):
    terms = definitions(*arguments)
    return terms | {"gravity": terms["gravity"] + energy}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The .grad attribute")  # torch's own look at what it traces
def test_what_a_gpu_compiles_is_traced_whole(monkeypatch):
    """Dynamo traces each function of a step as one graph, as it has to on a GPU: none goes back to Python."""

    def traced(function, device):
        return torch.compile(function, dynamic=False, fullgraph=True, backend="eager")

    plain = make_trainer(PAPER, kernels=False)
    for module in ("optimisation_step", "training_set", "physics_loss", "contact_planes",
                   "contact_cache_torch"):  # fmt: skip
        monkeypatch.setattr(f"snug.training.{module}.compile_for", traced)
    compiled = make_trainer(PAPER, kernels=False)
    for number in range(2):
        expected, losses = plain.step(number), compiled.step(number)
        assert losses == pytest.approx(expected, rel=1e-6)
