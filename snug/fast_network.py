"""Forward and backward of the recurrent network in closed form: what training on a CPU runs, not autograd.

For each layer, with gates r, z, candidate n and q = W_hn h + b_hn (torch.nn.GRU's convention):

    r = s(W_ir x + b_ir + W_hr h + b_hr)     z = s(W_iz x + b_iz + W_hz h + b_hz)
    n = tanh(W_in x + b_in + r q)            h' = (1 - z) n + z h

Two things make it faster than torch.nn.GRU under autograd: products of one sort are taken for all frames
together, weight gradients above all; and matrix products go to oneDNN where torch has it, which on a CPU with
AVX-512 that is not Intel's is twice as fast as MKL. The weights stay those of the modules.
tests/test_regressor.py holds values and gradients to the modules' own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from reference_sim.kernel_cache import njit

_LINEAR = (
    getattr(torch.ops.mkldnn, "_linear_pointwise", None) if torch.backends.mkldnn.is_available() else None
)


def product(a: Tensor, b: Tensor, bias: Tensor | None = None) -> Tensor:
    """a (n, k) times the transpose of b (m, k), plus bias (m,) -> (n, m), in float32 on a CPU."""
    if _LINEAR is not None:
        return _LINEAR(a, b, bias, "none", [], "")
    return nn.functional.linear(a, b, bias)


class FastGRU(torch.autograd.Function):
    """apply(x (N, T, D), state (L, N, H), *weights) -> (N, T, H), (L, N, H).

    weights: input, hidden, input bias, hidden bias of each layer. Differentiable once, by the weights alone:
    neither inputs nor the state at the start are trained, and the state that comes out is a constant.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, state: Tensor, *weights: Tensor) -> tuple[Tensor, Tensor]:
        x = x.transpose(0, 1).contiguous()  # time first: the frames of a step lie together
        saved, last = [], []
        for layer, start in enumerate(state):
            w_i, w_h, b_i, b_h = weights[4 * layer : 4 * layer + 4]
            (frames, count), size = x.shape[:2], w_h.shape[1]
            inputs = product(x.flatten(0, 1), w_i, b_i).view(frames, count, 3 * size)
            hidden = x.new_empty(frames + 1, count, size)
            gates = x.new_empty(frames, count, 4 * size)  # r, z, n, q
            hidden[0] = start
            for t in range(frames):
                recurrent = product(hidden[t], w_h, b_h)
                both, n, q = gates[t].split((2 * size, size, size), -1)
                torch.add(inputs[t, :, : 2 * size], recurrent[:, : 2 * size], out=both).sigmoid_()
                q.copy_(recurrent[:, 2 * size :])
                torch.addcmul(inputs[t, :, 2 * size :], both[:, :size], q, out=n).tanh_()
                torch.lerp(n, hidden[t], both[:, size:], out=hidden[t + 1])
            saved += [x, gates, hidden]
            x = hidden[1:]
            last.append(hidden[-1])
        ctx.save_for_backward(*weights, *saved)
        ctx.layers = len(state)
        ends = torch.stack(last)
        ctx.mark_non_differentiable(ends)
        return x.transpose(0, 1), ends

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> Any:
        weights, saved = ctx.saved_tensors[: 4 * ctx.layers], ctx.saved_tensors[4 * ctx.layers :]
        gradients: list[Tensor | None] = [None] * len(weights)
        y = above[0].transpose(0, 1)
        for layer in reversed(range(ctx.layers)):
            w_i, w_h = weights[4 * layer : 4 * layer + 2]
            x, gates, hidden = saved[3 * layer : 3 * layer + 3]
            to_inputs, to_recurrent = _back_in_time(y, gates, hidden, w_h)
            gradients[4 * layer : 4 * layer + 4] = [
                product(to_inputs.t(), x.flatten(0, 1).t()),
                product(to_recurrent.t(), hidden[:-1].flatten(0, 1).t()),
                to_inputs.sum(0),
                to_recurrent.sum(0),
            ]
            if layer:
                y = product(to_inputs, w_i.t()).view(*x.shape)
        return None, None, *gradients


def _back_in_time(y: Tensor, gates: Tensor, hidden: Tensor, w_h: Tensor) -> tuple[Tensor, Tensor]:
    """Gradients (T N, 3H) of what W_i x and W_h h gave, from those y (T, N, H) of a layer's outputs."""
    frames, count, size = y.shape
    to_inputs, to_recurrent = (y.new_empty(frames, count, 3 * size) for _ in range(2))
    back, y = y.new_zeros(count, size), y.contiguous()
    arrays = [tensor.numpy() for tensor in (y, gates, hidden, to_inputs, to_recurrent)]
    for t in reversed(range(frames)):
        _cell_back(back.numpy(), *(array[t] for array in arrays))
        if t:
            back += product(to_recurrent[t], w_h.t())
    return to_inputs.flatten(0, 1), to_recurrent.flatten(0, 1)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _cell_back(
    back: np.ndarray,
    y: np.ndarray,
    gates: np.ndarray,
    before: np.ndarray,
    to_inputs: np.ndarray,
    to_recurrent: np.ndarray,
) -> None:
    """One frame of a layer: back (N, H), the gradient of h' that comes from later frames, becomes what passes
    to h through z alone.
    """
    one, size = np.float32(1.0), back.shape[1]
    for i in range(len(back)):
        for j in range(size):
            r, z = gates[i, j], gates[i, size + j]
            n, q = gates[i, 2 * size + j], gates[i, 3 * size + j]
            whole = back[i, j] + y[i, j]
            to_n = whole * (one - z) * (one - n * n)
            to_r = to_n * q * r * (one - r)
            to_z = whole * (before[i, j] - n) * z * (one - z)
            to_inputs[i, j] = to_recurrent[i, j] = to_r
            to_inputs[i, size + j] = to_recurrent[i, size + j] = to_z
            to_inputs[i, 2 * size + j], to_recurrent[i, 2 * size + j] = to_n, to_n * r
            back[i, j] = whole * z


class FastLinear(torch.autograd.Function):
    """apply(x (N, T, k), weight (m, k), bias (m,)) -> (N, T, m): nn.Linear by `product`, its result laid out
    as (m, T, N), see snug.lanes.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        count, frames = x.shape[:2]
        rows = x.transpose(0, 1).flatten(0, 1)
        ctx.save_for_backward(rows, weight)
        y = product(weight, rows).add_(bias[:, None])
        return y.view(-1, frames, count).permute(2, 1, 0)

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> Any:
        rows, weight = ctx.saved_tensors
        count, frames, _ = above[0].shape
        y = above[0].permute(2, 1, 0).flatten(1)
        to_x = product(y.t(), weight.t()).view(frames, count, -1).transpose(0, 1)
        return to_x, product(y, rows.t()), y.sum(1)


def run_gru(gru: nn.GRU, x: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor]:
    """What gru(x, state) gives, for a gru of batches first, in one direction and without dropout."""
    if state is None:
        state = x.new_zeros(gru.num_layers, len(x), gru.hidden_size)
    weights = [weight for layer in gru.all_weights for weight in layer]
    return FastGRU.apply(x, state, *weights)


def run_linear(layer: nn.Linear, x: Tensor) -> Tensor:
    """What layer(x) gives, for x (..., k); by `product` where no gradient is asked for, in float32 on a CPU.

    A frame at a time the last layer is one pass over its weights, 13 MB at 4400 vertices: half of the run
    time of a frame, and of that oneDNN's product needs half.
    """
    if torch.is_grad_enabled() or x.device.type != "cpu" or x.dtype != torch.float32:
        return layer(x)
    return product(x.flatten(0, -2), layer.weight, layer.bias).view(*x.shape[:-1], -1)
