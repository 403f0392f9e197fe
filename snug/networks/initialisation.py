"""Random weights that a network starts from, by the rules of torch or of Keras.

The rules differ by orders of magnitude in the joules of the first frames: the offsets of a network begin as
noise, and noise of centimetres between neighbouring vertices is a great strain. SNUG's authors train in
Keras.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import nn

_GENERATOR = threading.Lock()  # torch's generator is one for all threads


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Draw from torch's generators as from a seed, and give them back as they were; threads take turns.

    Those of GPUs are left alone until something is on a GPU.

    >>> with seeded(0):
    ...     first = torch.rand(1)
    >>> with seeded(0):
    ...     bool(torch.rand(1) == first)
    True
    """
    on_gpus = torch.cuda.is_initialized()
    with _GENERATOR, torch.random.fork_rng(devices=range(torch.cuda.device_count()) if on_gpus else ()):
        if on_gpus:
            torch.manual_seed(seed)
        else:  # manual_seed would seed GPUs for when they are begun with
            torch.default_generator.manual_seed(seed)
        yield


def initialise(network: nn.Module, rules: str) -> None:
    """Give a network's linear layers and gated recurrent units the weights that they start from.

    Torch's rules are those by which its layers are made: uniform within 1 / sqrt(inputs), biases too, where a
    recurrent layer takes its units for inputs. Keras' rules: input weights uniform within
    sqrt(6 / (inputs + outputs)) (Glorot and Bengio 2010), where a recurrent layer of H units counts 3 H
    outputs, one for each of its gates; recurrent weights (3H, H) with orthonormal columns; biases zero. They
    are drawn from torch's global generator.

    Args:
        network: newly made; changed in place by Keras' rules.
        rules: one of snug.recipes.recipe.INITIALISATIONS.
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
