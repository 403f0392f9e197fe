"""Exact answers of bend-twist and stick-slip, by another method, and the numbers of the cases."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import curved_strips
import stick_slip
from curved_strips import ARCS, CURLS
from stick_slip import STRAINS


def integrated(slope, start):
    return solve_ivp(slope, (0, 1), start, rtol=1e-9, atol=1e-11).y[:, -1]


def shot_arc(curvature, stiffness_ratio, clamp, gamma):
    """Determinant of the end's moments for unit moments at the clamp: zero where the arc gives way."""
    # theta and M at the clamp: M' = Gamma (1 - s) sin theta, M(1) = 0
    loss = integrated(lambda s, y: [curvature, gamma * (1 - s) * np.sin(y[0])], [clamp, 0.0])[1]
    angles = [clamp, -loss]

    def slope(s, y):
        theta, moment, phi, psi, p, q = y  # p, q: derivatives of the energy by phi' and psi'
        tau = (p - moment * psi) / (2 * stiffness_ratio)
        beta = (q + moment * phi) / 2
        weight = gamma * (1 - s)
        return [
            curvature, weight * np.sin(theta), tau + curvature * psi, beta - curvature * phi,
            curvature * q - moment * beta + weight * psi * np.sin(theta),
            -curvature * p + moment * tau + weight * (2 * psi * np.cos(theta) + phi * np.sin(theta)),
        ]  # fmt: skip

    return np.linalg.det([integrated(slope, [*angles, 0, 0, *unit])[4:] for unit in ([1, 0], [0, 1])])


@pytest.mark.parametrize(
    ("curvature", "stiffness_ratio", "clamp"),
    [(1.0, 3.0, 0.0), (3.0, 3.0, 0.0), (5.0, 3.0, 0.0), (3.0, 0.7, 0.0), (0.0, 0.5, np.pi / 2),
     (-2.0, 1.0, 1.0)],
)  # fmt: skip
def test_the_weight_of_an_arc_is_that_of_shooting(curvature, stiffness_ratio, clamp):
    gamma = curved_strips.critical_gamma(curvature, stiffness_ratio, clamp)
    shot = brentq(lambda g: shot_arc(curvature, stiffness_ratio, clamp, g), 0.95 * gamma, 1.05 * gamma)
    assert shot == pytest.approx(gamma, rel=1e-4)
    # It is the first: the determinant keeps its sign from weightlessness on.
    signs = [
        np.sign(shot_arc(curvature, stiffness_ratio, clamp, f * gamma)) for f in (0.0, 0.3, 0.6, 0.9)
    ]
    assert len(set(signs)) == 1


def test_a_straight_strip_has_the_closed_form_on_edge_and_hangs_safely():
    assert curved_strips.critical_gamma(0.0, 4.0, np.pi / 2) == pytest.approx(2 * 12.853, rel=1e-3)
    assert curved_strips.critical_gamma(0.0, 3.0) == np.inf


def test_numbers_in_the_descriptions_are_the_exact_ones():
    ratio = curved_strips.TWIST / curved_strips.BENDING
    assert ratio == pytest.approx(3.0)
    for curvature, gamma in ARCS.items():
        assert curved_strips.critical_gamma(curvature, ratio) == pytest.approx(gamma, abs=0.05)
    for strain, friction in STRAINS.items():
        assert stick_slip.critical_friction(strain) == pytest.approx(friction, abs=5e-5)
        assert stick_slip.critical_strain(friction) == pytest.approx(strain, rel=1e-3)


@pytest.mark.parametrize("strain", STRAINS)
def test_the_pressed_elastica_is_that_of_shooting(strain):
    y, normal, aside = stick_slip.exact(strain)[1:]

    def miss(unknown):
        def slope(s, y):
            sine, cosine = np.sin(y[0]), np.cos(y[0])
            return [y[1], -(unknown[1] * sine + unknown[2] * cosine), sine, cosine]

        return integrated(slope, [0, unknown[0], 0, 0])[1:] - [0, 0, 1 - strain]

    unknowns = [y[1, 0], normal, aside]
    assert fsolve(miss, unknowns) == pytest.approx(unknowns, rel=1e-4)


def test_a_strip_hardly_pressed_has_the_load_of_a_column_clamped_and_hinged():
    normal, aside = stick_slip.exact(1e-4)[2:]
    assert normal == pytest.approx(20.19, rel=1e-3) and abs(aside) < 0.01 * normal


@pytest.mark.parametrize(("curvature", "gamma"), CURLS)
def test_the_curl_is_that_of_shooting(curvature, gamma):
    s, aside, depth = curved_strips.exact_curl(curvature, gamma)

    def end(bend):
        def slope(s, y):
            return [y[1], gamma * (1 - s) * np.sin(y[0]), np.sin(y[0]), np.cos(y[0])]

        return integrated(slope, [0, bend, 0, 0])

    at_clamp = (aside[1] - aside[0]) * 2 / s[1] ** 2  # theta' where the strip leaves the clamp, about
    (bend,) = fsolve(lambda b: end(b[0])[1] - curvature, [at_clamp])
    assert end(bend)[2:] == pytest.approx([aside[-1], depth[-1]], abs=1e-4)


def test_without_weight_the_curl_is_an_arc():
    aside, depth = curved_strips.exact_curl(2.0, 1e-9)[1:, -1]
    assert (aside, depth) == pytest.approx(((1 - np.cos(2.0)) / 2, np.sin(2.0) / 2), abs=1e-6)


def test_a_strip_that_does_not_break_loose_is_refused(monkeypatch):
    monkeypatch.setattr(stick_slip, "LOOSE", 10.0)
    with pytest.raises(RuntimeError, match="did not break loose"):
        stick_slip.breaking_loose(0.1)
