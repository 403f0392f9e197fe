"""Hinges folded by hand, through half a turn and flat on themselves."""

from __future__ import annotations

import numpy as np
import pytest
from numba import vectorize

from reference_sim import Cloth, Material
from reference_sim.energies import BendHinge, Energy
from reference_sim.kernels.lanes import arctan2
from tests.reference_sim.energies.test_derivatives import blocks_of, close


def hinge_at(phi: float) -> np.ndarray:
    """An edge along x, one wing in the plane z = 0, the other turned by phi about the edge."""
    return np.array([(0, 0, 0), (1, 0, 0), (0.3, 1, 0), (0.6, -np.cos(phi), -np.sin(phi))])


@pytest.mark.parametrize("phi", [2.9, np.pi - 1e-7, np.pi + 1e-7, 3.4])
@pytest.mark.parametrize("rest", [3.0, -3.0, 0.0])
def test_a_hinge_passes_through_half_a_turn(phi, rest):
    """Across phi = pi atan2 jumps by a full turn; energy, torque and stiffness must not notice.

    The energy takes the shorter way round to the rest angle, so only the point opposite to it is a kink.
    """
    # The edge has length 1 and each face half a square metre: scaled by 1/4, k is 2 J.
    cloth = Cloth(hinge_at(0.0), np.array([(0, 1, 2), (1, 0, 3)]), Material(bending_stiffness=8.0))
    energy, x = BendHinge(cloth, rest_angles=rest), hinge_at(phi)
    way = (phi - rest + np.pi) % (2 * np.pi) - np.pi
    value, gradient = energy.value_and_gradient(x)
    assert value == pytest.approx(way**2, rel=1e-12)
    turn = np.zeros((4, 3))
    turn[3] = (0, np.sin(phi), -np.cos(phi))  # dx/dphi
    assert np.vdot(gradient, turn) == pytest.approx(2 * way, rel=1e-12)  # k (theta - theta_0)
    curve = np.zeros((4, 3))
    curve[3] = (0, np.cos(phi), np.sin(phi))  # d2x/dphi2
    second = turn.ravel() @ blocks_of(energy, x)[0] @ turn.ravel() + np.vdot(gradient, curve)
    assert second == pytest.approx(2.0, rel=1e-12)  # k
    assert close(gradient, Energy.value_and_gradient(energy, x)[1], 1e-10)
    assert close(blocks_of(energy, x), Energy.hessian_blocks(energy, x), 1e-10)


def test_the_arctangent_of_the_kernels_is_that_of_numpy():
    """All around the circle, near its axes and diagonals, at any size."""
    generator = np.random.default_rng(4)
    angles = np.concatenate([generator.uniform(-np.pi, np.pi, 20_000), np.pi / 8 * np.arange(-7, 8)])
    angles = np.concatenate(
        [angles, angles[-15:] + 1e-9, angles[-15:] - 1e-9, 10.0 ** np.arange(-300, 0, 7)]
    )
    size = 10 ** generator.uniform(-100, 100, len(angles))
    y, x = size * np.sin(angles), size * np.cos(angles)
    y[-5:], x[-5:] = [0.0, -0.0, 0.0, 1.0, -1.0], [1.0, 1.0, -1.0, 0.0, 0.0]
    arctangents = vectorize(lambda y, x: arctan2(y, x))(y, x)
    expected = np.arctan2(y, x)
    assert (np.abs(arctangents - expected) <= 2 * np.spacing(np.abs(expected))).all()
