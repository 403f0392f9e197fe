"""Network and skinning of one frame as one compiled call, laid out by snug.networks.frame_layout.

A frame alone is one pass over all weights, matrix after matrix: its time is that of fetching them. So
each matrix lies in one piece, in the order of use, float32.
"""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit

# Kinds of operations: y = W x + b, y += that, its positive part, and that times its sigmoid (SiLU); a
# cell; offsets of a block of vertices by one handle, and those added; y += x.
PRODUCT, ADDED, RECTIFIED, SMOOTH, CELL, HANDLE, HANDLE_ADDED, SUM = range(8)
# A matrix has multiples of these: rows at once, and numbers in vector registers.
ROWS, COLUMNS = 4, 32
VERTEX_BLOCK = 64  # vertices that are skinned together
FAST = {"reassoc", "contract", "nsz"}  # a number that is not finite stays so
_ZERO, _ONE, _TWO, _HALF = (np.float32(x) for x in (0.0, 1.0, 2.0, 0.5))
_LOG2_E, _LN_2 = np.float32(np.log2(np.e)), np.float32(np.log(2.0))
_LOWEST, _HIGHEST, _BIAS, _SHIFT = np.float32(-126.0), np.float32(126.0), np.int32(127), np.int32(23)
_C2, _C3, _C4, _C5, _C6 = (np.float32(1.0 / n) for n in (2, 6, 24, 120, 720))


@njit(cache=True, fastmath=FAST, error_model="numpy")
def skin_frame(offsets, rest, first, joints, shares, order, transforms, pelvis, out):
    """Write world vertices into out (V, 3) [m], float64, by linear blend skinning.

    offsets (3 V',) and rest (3, V'), the unposed garment [m]: in this order (V,) of vertices and with
    others behind them, in blocks of VERTEX_BLOCK; joints[first[b]:first[b + 1]] move block b, with shares
    (., VERTEX_BLOCK).
    transforms (J, 3, 4). pelvis (3,) [m] is float64, other real numbers are float32.
    """
    count, padded = len(order), rest.shape[1]
    # Points and their images: nothing overlaps in one small array.
    u = np.empty(6 * VERTEX_BLOCK, np.float32)
    for b in range(len(first) - 1):
        for c in range(3):
            for i in range(VERTEX_BLOCK):
                at = b * VERTEX_BLOCK + i
                u[c * VERTEX_BLOCK + i] = rest[c, at] + offsets[c * padded + at]
                u[(3 + c) * VERTEX_BLOCK + i] = _ZERO
        for e in range(first[b], first[b + 1]):
            t, share = transforms[joints[e]], shares[e]
            for c in range(3):
                t0, t1, t2, t3 = t[c, 0], t[c, 1], t[c, 2], t[c, 3]
                for i in range(VERTEX_BLOCK):
                    moved = t0 * u[i] + t1 * u[VERTEX_BLOCK + i] + t2 * u[2 * VERTEX_BLOCK + i] + t3
                    u[(3 + c) * VERTEX_BLOCK + i] += share[i] * moved
        for i in range(min(VERTEX_BLOCK, count - b * VERTEX_BLOCK)):
            v = order[b * VERTEX_BLOCK + i]
            for c in range(3):
                out[v, c] = np.float64(u[(3 + c) * VERTEX_BLOCK + i]) + pelvis[c]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def run_frame(
    operations,
    weights,
    terms,
    features,
    rest,
    first,
    joints,
    shares,
    order,
    transforms,
    pelvis,
    work,
    out,
):
    """Write world vertices into out (V, 3) [m], float64, and the next state into work.

    operations (n, 7): kind, rows, columns, and where its weights, terms, what it reads and what it writes
    begin in `weights`, `terms` and `work`, which are flat; of a cell rows is its size and columns where
    its recurrent part begins; of SUM rows is its size; of HANDLE rows is how far apart two coordinates of
    a vertex are written, and columns how far apart their numbers are read. terms: mean and spread of the
    features (D,), which are normalised into work[:D], then factors and biases of each matrix. The
    offsets are the last of `work`. The others are those of skin_frame.
    """
    inputs = len(features)
    for i in range(inputs):
        work[i] = (features[i] - terms[i]) / terms[inputs + i]
    for i in range(len(operations)):
        kind, rows, columns = operations[i, 0], operations[i, 1], operations[i, 2]
        source, y = work[operations[i, 5] :], work[operations[i, 6] :]
        if kind == CELL:
            _cell(source, work[columns:], y, rows)
        elif kind == SUM:
            for j in range(rows):
                y[j] += source[j]
        elif kind in (HANDLE, HANDLE_ADDED):
            _handle(kind == HANDLE_ADDED, terms[operations[i, 4] :], source, y, rows, columns)
        else:
            matrix, affine = weights[operations[i, 3] :], terms[operations[i, 4] :]
            _multiply(kind, matrix, affine, source, y, rows, columns)
    skin_frame(work[len(work) - rest.size :], rest, first, joints, shares, order, transforms, pelvis, out)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _multiply(
    kind: int,
    weights: np.ndarray,
    terms: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    rows: int,
    columns: int,
) -> None:
    """Multiply four rows at once, a quarter of the matrix apart: four streams of memory are faster."""
    part = rows // ROWS
    for i in range(part):
        w0, w1 = weights[i * columns :], weights[(part + i) * columns :]
        w2, w3 = weights[(2 * part + i) * columns :], weights[(3 * part + i) * columns :]
        s0, s1, s2, s3 = _ZERO, _ZERO, _ZERO, _ZERO
        for k in range(columns):
            s0 += w0[k] * x[k]
            s1 += w1[k] * x[k]
            s2 += w2[k] * x[k]
            s3 += w3[k] * x[k]
        for r, s in enumerate((s0, s1, s2, s3)):
            j = r * part + i
            value = terms[j] * s + terms[rows + j]
            if kind == ADDED:
                value += y[j]
            elif kind == RECTIFIED and value < _ZERO:
                value = _ZERO
            elif kind == SMOOTH:
                value *= _sigmoid(value)
            y[j] = value


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _handle(
    added: bool, functions: np.ndarray, numbers: np.ndarray, y: np.ndarray, padded: int, stride: int
) -> None:
    """Write or add the offsets of a block: A [f_0 ... f_3], of numbers A (3, 4) and shape functions."""
    for c in range(3):
        a, at = numbers[c * stride :], y[c * padded :]
        a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
        for i in range(VERTEX_BLOCK):
            moved = a0 * functions[i] + a1 * functions[VERTEX_BLOCK + i]
            moved += a2 * functions[2 * VERTEX_BLOCK + i] + a3 * functions[3 * VERTEX_BLOCK + i]
            at[i] = at[i] + moved if added else moved


@njit(cache=True, inline="always", fastmath=FAST, error_model="numpy")
def _sigmoid(x: np.float32) -> np.float32:
    """Return 1 / (1 + exp(-x)), to 1e-7: exp = 2^k e^r, |r| <= ln(2) / 2, and e^r by its series."""
    y = -x * _LOG2_E
    y = _LOWEST if y < _LOWEST else y
    y = _HIGHEST if y > _HIGHEST else y
    k = np.int32(y + (_HIGHEST + _TWO + _HALF)) - np.int32(128)
    r = (y - np.float32(k)) * _LN_2
    e = _ONE + r * (_ONE + r * (_C2 + r * (_C3 + r * (_C4 + r * (_C5 + r * _C6)))))
    return _ONE / (_ONE + e * np.int32((k + _BIAS) << _SHIFT).view(np.float32))


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _cell(inputs: np.ndarray, recurrent: np.ndarray, state: np.ndarray, size: int) -> None:
    """Update a state by the gates of snug.kernels.gru from W_i x + b_i and W_h h + b_h, (3 size,) each."""
    for j in range(size):
        r = _sigmoid(inputs[j] + recurrent[j])
        z = _sigmoid(inputs[size + j] + recurrent[size + j])
        n = _TWO * _sigmoid(_TWO * (inputs[2 * size + j] + r * recurrent[2 * size + j])) - _ONE
        state[j] = n + z * (state[j] - n)
