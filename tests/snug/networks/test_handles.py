"""Handles: their shape functions, what they express, and a network of them in training."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from snug.body.skeleton import rotation_matrices
from snug.networks.handles import shape_functions
from tests.snug.training.dressing import tube_dress

COUNT = 20


@pytest.fixture(scope="module")
def garment():
    return replace(tube_dress().garment, pins=np.array([3, 77]))


def test_weights_are_a_partition_of_unity_without_the_pins(garment):
    weights = shape_functions(garment, COUNT)[..., 3]
    free = np.setdiff1d(np.arange(len(weights)), garment.pins)
    assert (weights >= 0.0).all() and np.abs(weights[free].sum(1) - 1.0).max() < 1e-14
    assert not weights[garment.pins].any()
    assert 1 < (weights[free] > 0).sum(1).max() < COUNT  # compact
    # Smooth to where a handle ends: its least weights are small.
    assert max(w[w > 0].min() for w in weights[free].T) < 0.05


def span(functions: np.ndarray) -> np.ndarray:
    """Return a basis (3 V, 12 B) of the offsets that shape functions (V, B, 4) express.

    Its columns belong to numbers in the order (3, B, 4): each function along x, then along y, then along
    z.
    """
    flat = functions.reshape(len(functions), -1)
    return np.einsum("vk,ij->vijk", flat, np.eye(3, dtype=flat.dtype)).reshape(3 * len(flat), -1)


@pytest.mark.parametrize("count", [1, 2, COUNT])
def test_handles_move_the_garment_rigidly_and_affinely_without_error(count):
    garment = tube_dress().garment
    rest = np.asarray(garment.rest_positions)
    rotation = rotation_matrices(np.array([0.4, -1.1, 0.3]))
    columns = span(shape_functions(garment, count))
    for matrix in (rotation, np.diag([1.1, 0.8, 1.0]) @ rotation):
        offsets = (rest @ matrix.T + [0.1, -0.2, 0.3] - rest).ravel()
        numbers = np.linalg.lstsq(columns, offsets)[0]
        assert np.abs(columns @ numbers - offsets).max() < 1e-12
    bent = (rest[:, 1:2] ** 2 * [1.0, 0.0, 0.0]).ravel()
    numbers = np.linalg.lstsq(columns, bent)[0]
    assert count > 2 or np.abs(columns @ numbers - bent).max() > 1e-3
