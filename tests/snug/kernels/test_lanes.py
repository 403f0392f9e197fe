"""Windows side by side: what is laid out comes back, and rows move as numpy moves them."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numba import njit

from reference_sim.kernels.fast_kernels import TRAINING_LANES
from reference_sim.kernels.lanes import add_lanes, copy_lanes, mixed_rows
from snug.kernels.skinning import from_lanes, to_lanes


@pytest.mark.parametrize(("windows", "frames"), [(16, 3), (32, 2), (1, 5), (5, 4), (21, 1)])
def test_what_is_laid_out_comes_back(windows, frames):
    x = torch.randn(windows, frames, 7, 3)
    lanes = to_lanes(x)
    assert (
        lanes.shape == (-(-windows * frames // TRAINING_LANES), 7, 3, TRAINING_LANES)
        and lanes.flags.c_contiguous
    )
    first = x[: min(windows, TRAINING_LANES), 0].movedim(0, -1).numpy()
    assert (lanes[0, ..., : first.shape[-1]] == first).all()
    assert torch.equal(from_lanes(lanes, windows, frames), x)


def test_of_sixteen_windows_nothing_is_copied():
    lanes = np.random.default_rng(0).normal(size=(3, 7, 3, TRAINING_LANES)).astype(np.float32)
    x = from_lanes(lanes, TRAINING_LANES, 3)
    assert x.shape == (TRAINING_LANES, 3, 7, 3) and np.shares_memory(to_lanes(x), lanes)


def test_rows_move_as_numpy_moves_them():
    @njit
    def moved(source, into, total, rows, out):
        copy_lanes(source, 2, into, 0)
        add_lanes(source, 1, into, 1)
        add_lanes(source, 1, total, 0)
        weights = np.float32(0.5), np.float32(2.0), np.float32(-1.0)
        out[0], out[1], out[2] = mixed_rows(rows, np.uint32(0), 3, 2, *weights)

    random = np.random.default_rng(0)
    source, into = (random.normal(size=(3, TRAINING_LANES)).astype(np.float32) for _ in range(2))
    rows, before = random.normal(size=(4, 3)).astype(np.float32), into.copy()
    total, out = np.ones(TRAINING_LANES), np.empty(3)
    moved(source.ravel(), into.ravel(), total, np.append(rows, np.float32(0.0)), out)
    assert (into == [source[2], before[1] + source[1], before[2]]).all()
    assert np.allclose(total, 1 + source[1].astype(float), rtol=1e-15)
    assert np.allclose(out, 0.5 * rows[0] + 2 * rows[3] - rows[2], atol=1e-6)
