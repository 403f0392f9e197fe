"""What a network does in one frame, laid out for the compiled call of snug.kernels.one_frame.

Each network says it by a method `lay_out(plan)`, in terms of its own modules: its `forward` for one frame.
All numbers of a frame, the state included, lie in one array. tests/snug/networks/test_one_frame.py holds every kind to
its `forward`.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from snug.kernels.one_frame import (
    ADDED,
    CELL,
    COLUMNS,
    LANES,
    PRODUCT,
    RECTIFIED,
    ROWS,
    SMOOTH,
    run_frame,
    skin_frame,
)

ACTIVATIONS = {nn.Identity: PRODUCT, nn.ReLU: RECTIFIED, nn.SiLU: SMOOTH}
PRECISIONS = ("float32", "bf16", "int8")  # in which matrices are stored; all else is float32


class CompiledFrame:
    """Skinning of an unposed garment, rest (V, 3) [m], weights (V, J), and before it a network's offsets.

    precision: that of the network's matrices in memory, one of PRECISIONS.
    """

    def __init__(
        self, rest: Tensor, weights: Tensor, network: Any = None, *, precision: str = "float32"
    ) -> None:
        order, *moved = _blocks(weights.numpy())
        unposed = np.zeros((3, LANES * (len(moved[0]) - 1)), np.float32)
        unposed[:, : len(order)] = rest.numpy()[order].T
        plan = FramePlan(order, unposed.shape[1], precision)
        if network is not None:
            network.lay_out(plan)
        self._laid = None if network is None else plan.laid()
        self._skinned = unposed, *moved, order
        self._numbers = plan.numbers

    def start(self) -> np.ndarray:
        """What a roll-out works on and keeps its state in, which is zero."""
        return np.zeros(self._numbers, np.float32)

    def __call__(
        self,
        features: np.ndarray,
        transforms: np.ndarray,
        pelvis: np.ndarray,
        work: np.ndarray,
        out: np.ndarray,
    ) -> None:
        """World vertices into `out` (V, 3) [m], float64, and the state after this frame into `work`.

        features (D,), none without a network, and transforms (J, 3, 4) are float32, pelvis (3,) [m] is
        float64.
        """
        if self._laid is None:  # who skins alone compiles no more than that
            skin_frame(work, *self._skinned, transforms, pelvis, out)
        else:
            run_frame(*self._laid, features, *self._skinned, transforms, pelvis, work, out)


class FramePlan:
    """The operations of one frame. order (V,): vertices as they are skinned; padded: places for them.

    Places of numbers are slices of the one array. Matrices are stored in the order in which they are named.
    """

    def __init__(self, order: np.ndarray, padded: int, precision: str) -> None:
        self._precision, self._room = precision, 0
        self._places = np.full(padded, len(order))
        self._places[: len(order)] = order
        self._operations: list[tuple[int, ...]] = []
        self._matrices: list[np.ndarray] = []
        self._terms: list[np.ndarray] = []

    @property
    def numbers(self) -> int:
        """Of a frame: all that was given a place, and the offsets behind."""
        return self._room + 3 * len(self._places)

    def laid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Operations, weights and terms as snug.kernels.one_frame.run_frame takes them."""
        operations = np.array(self._operations, np.int64)
        return operations, np.concatenate(self._matrices), np.concatenate(self._terms)

    def normalised(self, network: Any) -> slice:
        """The features by the network's mean and spread. It comes first."""
        self._terms += [network.input_mean.numpy(), network.input_std.numpy()]
        return self._place(len(network.input_mean))

    def linear(self, layer: Any, x: slice, activation: type[nn.Module] = nn.Identity) -> slice:
        """A torch.nn.Linear of the numbers at x, and of that one of ACTIVATIONS."""
        target = self._place(layer.out_features)
        self._product(ACTIVATIONS[activation], *_numbers_of(layer), x, target.start)
        return target

    def gru(self, gru: nn.GRU, x: slice) -> slice:
        """Recurrent units of the numbers at x: the new state of the last layer."""
        size = gru.hidden_size
        inputs, recurrent = self._place(3 * size), self._place(3 * size)
        for layer in gru.all_weights:
            w_i, w_h, b_i, b_h = (weight.detach().numpy() for weight in layer)
            state = self._place(size)
            self._product(PRODUCT, w_i, b_i, x, inputs.start)
            self._product(PRODUCT, w_h, b_h, state, recurrent.start)
            self._operations.append((CELL, size, recurrent.start, 0, 0, inputs.start, state.start))
            x = state
        return x

    def offsets(self, network: Any, *parts: tuple[Any, slice]) -> None:
        """The network's answer, (3 V,) by these layers of the numbers there, summed. It comes last."""
        places, vertices = self._places.copy(), network.vertices
        places[np.isin(places, network.pins)] = vertices  # as those behind: without offset
        rows = (3 * places + np.arange(3)[:, None]).ravel()
        for kind, (layer, x) in zip((PRODUCT, *[ADDED] * len(parts)), parts):
            matrix, bias = _numbers_of(layer)
            matrix, bias = np.pad(matrix, ((0, 3), (0, 0)))[rows], np.pad(bias, (0, 3))[rows]
            self._product(kind, matrix, bias, x, self._room, scale=network.output_scale)

    def _place(self, size: int) -> slice:
        """For so many numbers. Those behind them stay zero: matrices are read in whole vectors."""
        start = self._room
        self._room += _up(size + ROWS, COLUMNS)
        return slice(start, start + size)

    def _product(
        self, kind: int, matrix: np.ndarray, bias: np.ndarray, x: slice, target: int, *, scale: float = 1.0
    ) -> None:
        rows, columns = matrix.shape
        more = _up(rows, ROWS) - rows
        matrix = np.pad(matrix, ((0, more), (0, _up(columns, COLUMNS) - columns)))
        first = sum(map(len, self._matrices)), sum(map(len, self._terms))
        self._operations.append((kind, *matrix.shape, *first, x.start, target))
        weights, factors = stored(matrix, self._precision)
        self._matrices.append(weights.ravel())
        self._terms += [np.float32(scale) * factors, np.float32(scale) * np.pad(bias, (0, more))]


def stored(matrix: np.ndarray, precision: str) -> tuple[np.ndarray, np.ndarray]:
    """A matrix (m, n) of float32 as it lies in memory, and the factor of each row (m,).

    Raises ValueError for none of PRECISIONS.
    """
    if precision not in PRECISIONS:
        raise ValueError(f"unknown precision {precision!r}: use one of {', '.join(PRECISIONS)}")
    ones = np.ones(len(matrix), np.float32)
    if precision == "float32":
        return matrix, ones
    if precision == "bf16":
        return torch.from_numpy(matrix).bfloat16().view(torch.uint16).numpy(), ones
    largest = np.abs(matrix).max(axis=1)
    factors = np.where(largest > 0.0, largest / np.float32(127.0), ones)
    return np.rint(matrix / factors[:, None]).astype(np.int8), factors


def rounded(network: Any, precision: str) -> Any:
    """A copy of the network whose matrices are what is `stored` of its own."""
    network = copy.deepcopy(network)
    for parameter in network.parameters():
        if parameter.ndim == 2 and precision != "float32":
            values, factors = stored(parameter.detach().numpy(), precision)
            if precision == "bf16":
                values = (values.astype(np.uint32) << 16).view(np.float32)
            parameter.data = torch.from_numpy(values * factors[:, None])
    return network


def _numbers_of(layer: Any) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (m, n) and bias (m,) of a torch.nn.Linear."""
    bias = torch.zeros(layer.out_features) if layer.bias is None else layer.bias.detach()
    return layer.weight.detach().numpy(), bias.numpy()


def _blocks(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Skinning by blocks of LANES vertices and the joints that move any of them, weights (V, J): order (V,)
    of the vertices, first of the joints of each block (B + 1,), joints (E,), their shares (E, LANES).
    """
    main = np.argsort(-weights, axis=1, kind="stable")
    order = np.lexsort((main[:, 1], main[:, 0]))  # so that a block has few joints
    padded = np.zeros((_up(len(order), LANES), weights.shape[1]), np.float32)
    padded[: len(order)] = weights[order]
    blocks = padded.reshape(-1, LANES, weights.shape[1])
    block, joints = np.nonzero(blocks.any(axis=1))
    first = np.searchsorted(block, np.arange(len(blocks) + 1))
    return order, first, joints, np.ascontiguousarray(blocks[block, :, joints])


def _up(size: int, multiple: int) -> int:
    return -(-size // multiple) * multiple
