"""Recurrent network in closed form, forward and backward, for training on a CPU.

For each layer, with gates r, z, candidate n and q = W_hn h + b_hn (torch.nn.GRU's convention):

    r = s(W_ir x + b_ir + W_hr h + b_hr)     z = s(W_iz x + b_iz + W_hz h + b_hz)
    n = tanh(W_in x + b_in + r q)            h' = (1 - z) n + z h

Products of one sort are taken for all frames together, weight gradients above all; what stands between
them is one kernel; and forward products go to oneDNN where torch has it. The weights stay those of the
modules.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from llvmlite.binding import get_host_cpu_name
from torch import Tensor, nn

from reference_sim.kernels.fast_kernels import LANES
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import copy_lanes

# No assumption on NaN or infinity: the guard of training must see them.
FAST = {"contract", "nsz"}
_ONE, _HALF, _END = np.float32(1.0), np.float32(0.5), np.float32(9.0)  # tanh(9) is 1 in float32
# tanh(x) = x p(x^2) / q(x^2), q(0) = 1: a least-squares fit of its relative error, at most 2e-8 off.
_P0, _P1, _P2, _P3, _P4 = (
    np.float32(value)
    for value in (0.9999999795, 0.1338100071, 0.003495558104, 2.060857282e-05, 1.335393085e-08)
)
_Q1, _Q2, _Q3, _Q4 = (
    np.float32(value) for value in (0.4671431632, 0.02587686905, 0.0003285585030, 7.776264194e-07)
)

# Without AVX-512 oneDNN is the slower one; MKL makes no use of it on AMD's processors.
_ONEDNN = torch.backends.mkldnn.is_available() and torch.backends.cpu.get_cpu_capability() != "AVX2"
_LINEAR = getattr(torch.ops.mkldnn, "_linear_pointwise", None) if _ONEDNN else None
_MKL_IS_SLOW = get_host_cpu_name().startswith("znver")


def product(a: Tensor, b: Tensor, bias: Tensor | None = None) -> Tensor:
    """Return a (n, k) times the transpose of b (m, k), plus bias (m,), (n, m) in float32 on a CPU.

    oneDNN first lays out anew a b that is itself a transpose, as in every backward product: where MKL is
    as fast, those are its.
    """
    if _LINEAR is not None and (_MKL_IS_SLOW or b.is_contiguous()):
        return _LINEAR(a, b, bias, "none", [], "")
    return nn.functional.linear(a, b, bias)


class FastGRU(torch.autograd.Function):
    """apply(x (N, T, D), state (L, N, H), *weights) -> (N, T, H), (L, N, H).

    weights: input, hidden, input bias, hidden bias of each layer. Differentiable once, by the weights
    alone. Between products a row of units is as wide as the next multiple of LANES, and 0
    beyond H.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, state: Tensor, *weights: Tensor) -> tuple[Tensor, Tensor]:
        """Return the outputs of the last layer and the states after the last frame."""
        x = x.transpose(0, 1).contiguous()  # time first: the frames of a step lie together
        saved, last = [], []
        for layer, start in enumerate(state):
            w_i, w_h, b_i, b_h = weights[4 * layer : 4 * layer + 4]
            (frames, count), size = x.shape[:2], w_h.shape[1]
            wide = size + -size % LANES
            inputs = _widen(product(x.flatten(0, 1), w_i, b_i), size).view(frames, count, -1)
            hidden = x.new_zeros(frames + 1, count, wide)
            gates = x.new_empty(frames, count, 4 * wide)  # r, z, n, q
            hidden[0, :, :size] = start
            for t in range(frames):
                recurrent = _widen(product(hidden[t, :, :size].contiguous(), w_h, b_h), size)
                arrays = inputs[t], recurrent, hidden[t], gates[t], hidden[t + 1]
                _cell(*(array.numpy().ravel() for array in arrays), wide // LANES)
            saved += [x, gates, hidden]
            x = hidden[1:, :, :size].contiguous()
            last.append(hidden[-1, :, :size])
        ctx.save_for_backward(*weights, *saved)
        ctx.layers = len(state)
        ends = torch.stack(last)
        ctx.mark_non_differentiable(ends)
        return x.transpose(0, 1), ends

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[Tensor | None, ...]:
        """Return the gradients by the weights."""
        weights, saved = ctx.saved_tensors[: 4 * ctx.layers], ctx.saved_tensors[4 * ctx.layers :]
        gradients: list[Tensor | None] = [None] * len(weights)
        y = above[0].transpose(0, 1)
        for layer in reversed(range(ctx.layers)):
            w_i, w_h = weights[4 * layer : 4 * layer + 2]
            x, gates, hidden = saved[3 * layer : 3 * layer + 3]
            to_inputs, to_recurrent = _backpropagate(y, gates, hidden, w_h)
            before = hidden[:-1, :, : w_h.shape[1]].contiguous().flatten(0, 1)
            gradients[4 * layer : 4 * layer + 4] = [
                product(to_inputs.t(), x.flatten(0, 1).t()),
                product(to_recurrent.t(), before.t()),
                to_inputs.sum(0),
                to_recurrent.sum(0),
            ]
            if layer:
                y = product(to_inputs, w_i.t()).view(*x.shape)
        return None, None, *gradients


def _backpropagate(y: Tensor, gates: Tensor, hidden: Tensor, w_h: Tensor) -> tuple[Tensor, Tensor]:
    """Return the gradients (T N, 3H) by W_i x and by W_h h, from those y (T, N, H) by a layer's outputs."""
    (frames, count, size), wide = y.shape, hidden.shape[-1]
    to_inputs, to_recurrent = (y.new_empty(frames, count, 3 * wide) for _ in range(2))
    back, y = y.new_zeros(count, wide), _widen(y.contiguous(), size)
    arrays = [tensor.numpy() for tensor in (y, gates, hidden, to_inputs, to_recurrent)]
    for t in reversed(range(frames)):
        _cell_back(back.numpy().ravel(), *(array[t].ravel() for array in arrays), wide // LANES)
        if t:
            back[:, :size] += product(_narrow(to_recurrent[t], size), w_h.t())
    return _narrow(to_inputs.flatten(0, 1), size), _narrow(to_recurrent.flatten(0, 1), size)


def _widen(rows: Tensor, size: int) -> Tensor:
    """Fill each of the k parts of rows (..., k H), H of this size, with 0 to a multiple of LANES."""
    if size % LANES == 0:
        return rows
    return nn.functional.pad(rows.unflatten(-1, (-1, size)), (0, -size % LANES)).flatten(-2)


def _narrow(rows: Tensor, size: int) -> Tensor:
    """Return rows without the zeros of `_widen`."""
    return rows.unflatten(-1, (-1, size + -size % LANES))[..., :size].flatten(-2)


@njit(cache=True, inline="always", fastmath=FAST, error_model="numpy")
def _tanh(x: np.float32) -> np.float32:
    """Return tanh in float32, at most 4e-7 off; NaN for NaN."""
    x = _END if x > _END else x
    x = -_END if x < -_END else x
    z = x * x
    above = _P0 + z * (_P1 + z * (_P2 + z * (_P3 + z * _P4)))
    return x * above / (_ONE + z * (_Q1 + z * (_Q2 + z * (_Q3 + z * _Q4))))


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _cell(
    inputs: np.ndarray,
    recurrent: np.ndarray,
    before: np.ndarray,
    gates: np.ndarray,
    after: np.ndarray,
    blocks: int,
) -> None:
    """Compute one frame of a layer: r, z, n, q (N, 4H) and h' (N, H) from W_i x, W_h h (N, 3H) and h (N, H).

    All flat, with H, widened, of so many blocks of LANES.
    """
    L, u = LANES, np.empty(7 * LANES, np.float32)
    for place in range(len(after) // L):
        row, block = divmod(place, blocks)
        for part in range(3):
            copy_lanes(inputs, (3 * row + part) * blocks + block, u, part)
            copy_lanes(recurrent, (3 * row + part) * blocks + block, u, 3 + part)
        copy_lanes(before, place, u, 6)
        for j in range(L):
            r = _HALF + _HALF * _tanh(_HALF * (u[j] + u[3 * L + j]))
            z = _HALF + _HALF * _tanh(_HALF * (u[L + j] + u[4 * L + j]))
            q = u[5 * L + j]
            n = _tanh(u[2 * L + j] + r * q)
            u[j], u[L + j], u[2 * L + j], u[3 * L + j] = r, z, n, q
            u[4 * L + j] = n + z * (u[6 * L + j] - n)
        for part in range(4):
            copy_lanes(u, part, gates, (4 * row + part) * blocks + block)
        copy_lanes(u, 4, after, place)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _cell_back(
    back: np.ndarray,
    y: np.ndarray,
    gates: np.ndarray,
    before: np.ndarray,
    to_inputs: np.ndarray,
    to_recurrent: np.ndarray,
    blocks: int,
) -> None:
    """Go back through one frame of a layer, all flat as in `_cell`.

    back (N, H), the gradient by h' from later frames, becomes the part that passes to h through z alone.
    """
    L, u = LANES, np.empty(7 * LANES, np.float32)
    for place in range(len(back) // L):
        row, block = divmod(place, blocks)
        for part in range(4):
            copy_lanes(gates, (4 * row + part) * blocks + block, u, part)
        for part, array in enumerate((back, y, before)):
            copy_lanes(array, place, u, 4 + part)
        for j in range(L):
            r, z, n, q = u[j], u[L + j], u[2 * L + j], u[3 * L + j]
            gradient = u[4 * L + j] + u[5 * L + j]
            to_n = gradient * (_ONE - z) * (_ONE - n * n)
            u[j] = to_n * q * r * (_ONE - r)
            u[L + j] = gradient * (u[6 * L + j] - n) * z * (_ONE - z)
            u[2 * L + j], u[3 * L + j] = to_n, to_n * r
            u[4 * L + j] = gradient * z
        for part in range(3):
            copy_lanes(u, part, to_inputs, (3 * row + part) * blocks + block)
            copy_lanes(u, part + (part == 2), to_recurrent, (3 * row + part) * blocks + block)
        copy_lanes(u, 4, back, place)


class FastLinear(torch.autograd.Function):
    """apply(x (N, T, k), weight (m, k), bias (m,)) -> (N, T, m): nn.Linear by `product`.

    Its result lies in memory as (m, T, N), see snug.kernels.skinning.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """Return the layer's outputs."""
        count, frames = x.shape[:2]
        rows = x.transpose(0, 1).flatten(0, 1)
        ctx.save_for_backward(rows, weight)
        y = product(weight, rows).add_(bias[:, None])
        return y.view(-1, frames, count).permute(2, 1, 0)

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the gradients by x, weight and bias."""
        rows, weight = ctx.saved_tensors
        count, frames, _ = above[0].shape
        y = above[0].permute(2, 1, 0).flatten(1)
        to_x = product(y.t(), weight.t()).view(frames, count, -1).transpose(0, 1)
        return to_x, product(y, rows.t()), y.sum(1)


def run_gru(gru: nn.GRU, x: Tensor, state: Tensor | None, *, closed_form: bool) -> tuple[Tensor, Tensor]:
    """Return gru(x, state), for a gru of batches first, in one direction and without dropout.

    closed_form: use FastGRU where a gradient is needed.
    """
    if not (closed_form and torch.is_grad_enabled()):
        return gru(x, state)
    if state is None:
        state = x.new_zeros(gru.num_layers, len(x), gru.hidden_size)
    weights = [weight for layer in gru.all_weights for weight in layer]
    return FastGRU.apply(x, state, *weights)


def run_linear(layer: nn.Linear, x: Tensor, *, closed_form: bool = False) -> Tensor:
    """Return layer(x), x (..., k); by `product` where no gradient is needed, in float32 on a CPU.

    closed_form: x (N, T, k) by FastLinear where a gradient is needed.
    """
    if closed_form and torch.is_grad_enabled():
        return FastLinear.apply(x, layer.weight, layer.bias)
    if torch.is_grad_enabled() or x.device.type != "cpu" or x.dtype != torch.float32:
        return layer(x)
    return product(x.flatten(0, -2), layer.weight, layer.bias).view(*x.shape[:-1], -1)
