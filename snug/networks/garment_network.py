"""Base class of the networks that dress a body: body motion in, offsets of the unposed garment out.

They start from random weights by the rules of torch or of Keras, in which SNUG's authors train. The two
differ by orders of magnitude in the joules of the first frames.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from snug.kinds import find_kind
from snug.networks.frame_layout import FramePlan
from snug.recipe import Recipe

if TYPE_CHECKING:
    from snug.garments.garment import Garment


class GarmentNetwork(nn.Module):
    """A map from features (N, T, D) and a state to offsets (N, T, V, 3) [m] and the next state.

    The features are normalised inside, by the mean and spread of the training frames.

    Attributes:
        feature_set: inputs it reads, one of snug.networks.dressed_body.FEATURE_SETS.
        sequential: whether it carries a state from frame to frame.
        lead: frames before a training window that it reads first, from a state of zero, with their
            gradient.
        closed_form: whether it trains by snug.kernels.gru, on a CPU; its next state then has no gradient.
        pins: vertices without offset, which the body carries; see `make_network`.
        output_scale: factor on the predicted offsets.
        offsets: last layer; a network without one overrides `last_layers`.
        gru: recurrent units, whose state (layers, N, hidden) is the network's; a `sequential` network
            without them overrides `random_state`.
    """

    feature_set: ClassVar[str]
    sequential: ClassVar[bool]
    lead: ClassVar[int] = 0
    closed_form: bool = False
    pins: tuple[int, ...] = ()
    output_scale: float = 1.0
    input_mean: Tensor
    input_std: Tensor
    offsets: nn.Linear
    gru: nn.GRU

    def __init__(self, inputs: int, vertices: int) -> None:
        super().__init__()
        self.vertices = vertices
        self.register_buffer("input_mean", torch.zeros(inputs))
        self.register_buffer("input_std", torch.ones(inputs))

    def normalise_by(self, mean: np.ndarray, std: np.ndarray) -> None:
        """Set the mean (D,) and spread (D,) of the inputs."""
        self.input_mean.copy_(torch.as_tensor(mean))
        self.input_std.copy_(torch.as_tensor(std))

    def normalise(self, features: Tensor) -> Tensor:
        """Return the features (N, T, D) less their mean, over their spread."""
        return (features - self.input_mean) / self.input_std

    def wear(self, garment: Garment) -> None:
        """Take what the garment fixes of the network, before it is trained. Nothing by default."""

    def random_state(self, batch: int, sigma: float, generator: torch.Generator) -> Tensor | None:
        """Draw the state that a training window starts from; None where there is none, or a `lead` gives it.

        By default it is that of `gru`, from N(0, sigma); the noise keeps long roll-outs stable.
        """
        if not self.sequential or self.lead:
            return None
        shape = (self.gru.num_layers, batch, self.gru.hidden_size)
        state = sigma * torch.randn(shape, generator=generator, device=generator.device)
        return state.to(self.input_mean.device)

    def state_after(self, features: Tensor) -> Tensor:
        """Return the state after frames with features (N, T, D), for a network with `lead`."""
        raise NotImplementedError

    def last_layers(self) -> tuple[nn.Linear, ...]:
        """Return the layers whose sum the offsets are."""
        return (self.offsets,)

    def lay_out(self, plan: FramePlan, x: slice) -> None:
        """Add the operations of `forward` for one frame to the plan, of normalised features at x."""
        raise NotImplementedError

    @property
    def megabytes(self) -> float:
        """Memory of the weights and of the input normalisation [MB]."""
        tensors = [*self.parameters(), *self.buffers()]
        return sum(t.numel() * t.element_size() for t in tensors) / 1e6


def perceptron(*widths: int, bias: bool = True, activation: type[nn.Module] = nn.ReLU) -> nn.Sequential:
    """Return linear layers of these widths, the first those of the inputs, each with an activation."""
    sizes = pairwise(widths)
    return nn.Sequential(
        *(layer for a, b in sizes for layer in (nn.Linear(a, b, bias=bias), activation()))
    )


_GENERATOR = threading.Lock()  # torch's generator is one for all threads


@contextmanager
def seed_torch(seed: int) -> Iterator[None]:
    """Draw from torch's CPU generator as from a seed, and give it back as it was; threads take turns.

    >>> with seed_torch(0):
    ...     first = torch.rand(1)
    >>> with seed_torch(0):
    ...     bool(torch.rand(1) == first)
    True
    """
    with _GENERATOR, torch.random.fork_rng(devices=()):
        torch.default_generator.manual_seed(seed)
        yield


def initialise(network: nn.Module, rules: str) -> None:
    """Give a network's linear layers and gated recurrent units the weights that they start from.

    Torch's rules are those by which its layers are made: uniform within 1 / sqrt(inputs), biases too,
    where a recurrent layer takes its units for inputs. Keras' rules: input weights uniform within
    sqrt(6 / (inputs + outputs)) (Glorot and Bengio 2010), where a recurrent layer of H units counts 3 H
    outputs, one for each of its gates; recurrent weights (3H, H) with orthonormal columns; biases zero.
    They are drawn from torch's global generator. rules: one of snug.recipe.INITIALISATIONS.
    """
    if rules == "torch":
        return
    for layer in network.modules():
        named = layer.named_parameters() if isinstance(layer, (nn.Linear, nn.GRU)) else ()
        for name, parameter in named:
            if "bias" in name:
                nn.init.zeros_(parameter)
            elif name.startswith("weight_hh"):
                nn.init.orthogonal_(parameter)
            else:
                limit = math.sqrt(6 / sum(parameter.shape))
                nn.init.uniform_(parameter, -limit, limit)


def make_network(
    kind: str, inputs: int, vertices: int, recipe: Recipe, *, seed: int, pins: Iterable[int] = ()
) -> GarmentNetwork:
    """Make a network at its start; the same seed gives the same weights, whatever was drawn before.

    Its features (N, T, D) have D = inputs, its offsets are none at the pins. Raises ValueError for an
    unknown kind.

    Example:
        >>> from snug.recipe import DEFAULT
        >>> network = make_network("pbns", 141, 4, DEFAULT, seed=0)
        >>> offsets, state = network(torch.zeros(2, 3, 141))
        >>> tuple(offsets.shape), state
        ((2, 3, 4, 3), None)
    """
    spec = find_kind(kind)
    with seed_torch(seed):
        network = spec.network(inputs, vertices, *spec.sizes)
        initialise(network, recipe.initialisation)
    network.output_scale = recipe.output_scale
    if recipe.zero_last_layer:
        for layer in network.last_layers():  # training then starts at the skinned garment
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)
    network.pins = tuple(pins)
    if network.pins:
        free = torch.ones(vertices, 1)
        free[list(network.pins)] = 0.0
        network.register_buffer("free", free, persistent=False)

        # Not a closure over `free`: the buffer moves with the network to a GPU.
        network.register_forward_hook(lambda net, _, out: (out[0] * net.get_buffer("free"), out[1]))
    return network
