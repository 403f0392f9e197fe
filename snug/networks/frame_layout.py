"""One frame of a network and skinning, laid out for the compiled call of snug.kernels.one_frame.

Each network adds its operations by `lay_out(plan, x)`, in terms of its own modules: its `forward` for one
frame. All numbers of a frame, the state included, lie in one array.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from snug.kernels.one_frame import (
    ADDED,
    CELL,
    COLUMNS,
    HANDLE,
    HANDLE_ADDED,
    PRODUCT,
    RECTIFIED,
    ROWS,
    SMOOTH,
    SUM,
    VERTEX_BLOCK,
)

ACTIVATIONS = {nn.Identity: PRODUCT, nn.ReLU: RECTIFIED, nn.SiLU: SMOOTH}


class FramePlan:
    """The operations of one frame, and the array of all its numbers.

    Places of numbers are slices of that array. Matrices are stored in the order in which they are named.
    order: vertices (V,) as they are skinned; padded: their number, filled up to whole blocks.
    """

    def __init__(self, order: np.ndarray, padded: int, *, pins: Sequence[int], scale: float) -> None:
        self._used, self._scale = 0, scale
        self._places = np.full(padded, len(order))
        self._places[: len(order)] = order
        self._free = np.where(np.isin(self._places, pins), len(order), self._places)
        self._operations: list[tuple[int, ...]] = []
        self._matrices: list[np.ndarray] = []
        self._terms: list[np.ndarray] = []

    @property
    def size(self) -> int:
        """Length of the array: all numbers that have a place, and the offsets behind them."""
        return self._used + 3 * len(self._places)

    def operations(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return operations, weights and terms as snug.kernels.one_frame.run_frame takes them."""
        operations = np.array(self._operations, np.int64)
        return operations, np.concatenate(self._matrices), np.concatenate(self._terms)

    def add_normalised(self, mean: Tensor, std: Tensor) -> slice:
        """Add the features less their mean (D,), over their spread (D,); to be called first."""
        self._terms += [mean.numpy(), std.numpy()]
        return self._place(len(mean))

    def add_linear(self, layer: nn.Linear, x: slice, activation: type[nn.Module] = nn.Identity) -> slice:
        """Add a linear layer of the numbers at x, followed by one of ACTIVATIONS."""
        target = self._place(layer.out_features)
        self._product(ACTIVATIONS[activation], *_numbers_of(layer), x, target.start)
        return target

    def add_layers(self, layers: nn.Sequential, x: slice) -> slice:
        """Add the layers of snug.networks.garment_network.perceptron; return the place of their outputs."""
        for layer, activation in pairwise(layers):
            if isinstance(layer, nn.Linear):
                x = self.add_linear(layer, x, type(activation))
        return x

    def add_gru(self, gru: nn.GRU, x: slice) -> slice:
        """Add recurrent units of the numbers at x; return the place of the last layer's new state."""
        size = gru.hidden_size
        inputs, recurrent = self._place(3 * size), self._place(3 * size)
        for layer in gru.all_weights:
            w_i, w_h, *biases = (weight.detach().numpy() for weight in layer)
            b_i, b_h = biases or [np.zeros(3 * size, np.float32)] * 2
            state = self._place(size)
            self._product(PRODUCT, w_i, b_i, x, inputs.start)
            self._product(PRODUCT, w_h, b_h, state, recurrent.start)
            self._operations.append((CELL, size, recurrent.start, 0, 0, inputs.start, state.start))
            x = state
        return x

    def add_sum(self, place: slice, x: slice) -> None:
        """Add the numbers at x to those at a place of the same size."""
        self._operations.append((SUM, x.stop - x.start, 0, 0, 0, x.start, place.start))

    def add_offsets(self, *parts: tuple[nn.Linear, slice]) -> None:
        """Add the offsets (3 V,), the sum of linear layers of the numbers at places; to be called last."""
        # The offset of the network that each of the frame's is; 3 V to 3 V + 2 for none.
        rows = (3 * self._free + np.arange(3)[:, None]).ravel()
        for kind, (layer, x) in zip((PRODUCT, *[ADDED] * len(parts)), parts):
            matrix, bias = _numbers_of(layer)
            matrix, bias = np.pad(matrix, ((0, 3), (0, 0)))[rows], np.pad(bias, (0, 3))[rows]
            self._product(kind, matrix, bias, x, self._used, scale=self._scale)

    def add_handles(self, functions: Tensor, x: slice) -> None:
        """Add the offsets of handles whose numbers lie at x, with shape functions (V, B, 4); called last.

        Each block of vertices reads the handles that reach it.
        """
        count, padded = functions.shape[1], len(self._places)
        values = np.concatenate([functions.detach().numpy(), np.zeros((1, count, 4), np.float32)])
        values = np.float32(self._scale) * values[self._free]
        for block in range(padded // VERTEX_BLOCK):
            part = values[block * VERTEX_BLOCK : (block + 1) * VERTEX_BLOCK]
            reaching = np.flatnonzero(part.any(axis=(0, 2)))
            for place, handle in enumerate(reaching.tolist() or [0]):
                kind = HANDLE_ADDED if place else HANDLE
                terms, target = sum(map(len, self._terms)), self._used + block * VERTEX_BLOCK
                numbers = x.start + 4 * handle
                self._operations.append((kind, padded, 4 * count, 0, terms, numbers, target))
                self._terms.append(np.ascontiguousarray(part[:, handle].T).ravel())

    def _place(self, size: int) -> slice:
        """Reserve a place for `size` numbers; those behind stay zero, read in whole vectors."""
        start = self._used
        self._used += _up(size + ROWS, COLUMNS)
        return slice(start, start + size)

    def _product(
        self,
        kind: int,
        matrix: np.ndarray,
        bias: np.ndarray,
        x: slice,
        target: int,
        *,
        scale: float = 1.0,
    ) -> None:
        rows, columns = matrix.shape
        pad = _up(rows, ROWS) - rows
        matrix = np.pad(matrix, ((0, pad), (0, _up(columns, COLUMNS) - columns)))
        starts = sum(map(len, self._matrices)), sum(map(len, self._terms))
        self._operations.append((kind, *matrix.shape, *starts, x.start, target))
        self._matrices.append(matrix.ravel())
        self._terms += [
            np.full(len(matrix), scale, np.float32),
            np.float32(scale) * np.pad(bias, (0, pad)),
        ]


def _numbers_of(layer: nn.Linear) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix (m, n) and bias (m,) of a linear layer."""
    bias = torch.zeros(layer.out_features) if layer.bias is None else layer.bias.detach()
    return layer.weight.detach().numpy(), bias.numpy()


def blocks_of_vertices(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Sort vertices into blocks of VERTEX_BLOCK, and find the joints that move any vertex of a block.

    weights (V, J) -> order (V,) of the vertices, first of the joints of each block (B + 1,), joints (E,),
    their shares (E, VERTEX_BLOCK).
    """
    main = np.argsort(-weights, axis=1, kind="stable")
    order = np.lexsort((main[:, 1], main[:, 0]))  # so that a block has few joints
    padded = np.zeros((_up(len(order), VERTEX_BLOCK), weights.shape[1]), np.float32)
    padded[: len(order)] = weights[order]
    blocks = padded.reshape(-1, VERTEX_BLOCK, weights.shape[1])
    block, joints = np.nonzero(blocks.any(axis=1))
    first = np.searchsorted(block, np.arange(len(blocks) + 1))
    return order, first, joints, np.ascontiguousarray(blocks[block, :, joints])


def _up(size: int, multiple: int) -> int:
    return -(-size // multiple) * multiple
