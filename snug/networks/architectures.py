"""The network of each kind of model, and its start from a seed."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from snug.networks.fitted import NearestPoses, PoseRegression
from snug.networks.garment_network import GarmentNetwork, initialise, seeded
from snug.networks.handles import DynamicHandles80, Handles20, Handles40, Handles80
from snug.networks.ncs import StaticBranch, TwoBranches
from snug.networks.pbns import PoseSpaceDeformation
from snug.networks.regressor import MotionPerceptron, Regressor
from snug.networks.santesteban2019 import FitAndWrinkles
from snug.networks.tailornet import FrequencyMixture
from snug.recipe import Recipe

ARCHITECTURES: dict[str, type[GarmentNetwork]] = {
    "snug": Regressor,
    "dynamic": MotionPerceptron,
    "supervised": Regressor,
    "pbns": PoseSpaceDeformation,
    "santesteban2019": FitAndWrinkles,
    "tailornet": FrequencyMixture,
    "nearest-poses": NearestPoses,
    "pose-regression": PoseRegression,
    "handles-20": Handles20,
    "handles-40": Handles40,
    "handles-80": Handles80,
    "handles-80-dynamic": DynamicHandles80,
    "ncs": TwoBranches,
    "ncs-static": StaticBranch,
}


def find_architecture(kind: str) -> type[GarmentNetwork]:
    """Return the network of that kind of model. Raises ValueError naming the known kinds."""
    if kind not in ARCHITECTURES:
        raise ValueError(f"unknown model {kind!r}: use one of {', '.join(ARCHITECTURES)}")
    return ARCHITECTURES[kind]


def make_network(
    kind: str, inputs: int, vertices: int, recipe: Recipe, *, seed: int, pins: Iterable[int] = ()
) -> GarmentNetwork:
    """Make a network at its start; the same seed gives the same weights, whatever was drawn before.

    Args:
        kind: one of ARCHITECTURES.
        inputs: number of features D.
        vertices: number of vertices V.
        recipe: gives the rules of initialisation, whether the last layer starts at zero instead, and the
            scale of the output.
        seed: of the random weights.
        pins: vertices without offset, which the body carries.

    Returns:
        A network that maps features (N, T, D) to offsets (N, T, V, 3) [m].

    Raises:
        ValueError: for an unknown kind.

    Example:
        >>> from snug.recipe import DEFAULT
        >>> network = make_network("pbns", 141, 4, DEFAULT, seed=0)
        >>> offsets, state = network(torch.zeros(2, 3, 141))
        >>> tuple(offsets.shape), state
        ((2, 3, 4, 3), None)
    """
    architecture = find_architecture(kind)
    with seeded(seed):
        network = architecture(inputs, vertices, output_scale=recipe.output_scale)
        initialise(network, recipe.initialisation)
    if recipe.zero_last_layer:
        for layer in network.last_layers():  # training then starts at the skinned garment
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)
    network.pins = tuple(pins)
    if network.pins:
        free = torch.ones(vertices, 1)
        free[list(network.pins)] = 0.0
        network.register_buffer("free", free, persistent=False)

        def hold_pins(
            network: nn.Module, _features: object, output: tuple[Tensor, Tensor | None]
        ) -> tuple[Tensor, Tensor | None]:
            return output[0] * network.get_buffer("free"), output[1]

        network.register_forward_hook(hold_pins)
    return network
