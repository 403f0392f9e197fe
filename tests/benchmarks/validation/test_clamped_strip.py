"""The elastica by shooting: another method than the collocation of the code."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.validation.clamped_strip import exact_elastica


def shot(gamma: float) -> tuple[float, float]:
    """Width and height of the elastica."""

    def at_end(curvature):
        def slope(s, y):
            return [y[1], -gamma * (1 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(slope, (0, 1), [0, curvature, 0, 0], rtol=1e-10, atol=1e-12).y[:, -1]

    curvature = brentq(lambda c: at_end(c)[1], 0.0, gamma / 2)
    return at_end(curvature)[2], at_end(curvature)[3]


@pytest.mark.parametrize("gamma", [0.5, 8.0, 40.0])
def test_the_elastica_is_that_of_shooting(gamma):
    assert exact_elastica(gamma, 0.0)[1][:, -1] == pytest.approx(shot(gamma), rel=1e-5)
