"""Windows side by side: what is laid out comes back, and rows move as numpy moves them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from reference_sim.kernels.fast_kernels import TRAINING_LANES
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
