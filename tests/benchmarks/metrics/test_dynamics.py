"""Dynamic metrics on hems whose motion is known: a sine of known gain and lag, a damped ring, a walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.method import MethodEntry
from benchmarks.methods import find_method
from benchmarks.metrics import dynamics
from benchmarks.metrics.dynamics import HemMotion, amplitude, correlation, gain_and_lag, hem_yaw, response
from benchmarks.scene import BuiltScene, Dressed
from tests.benchmarks.runner.tasks_by_hand import grouped
from tests.snug.training.dressing import AROUND, swaying, tube_dress

DT = 1 / 30
FRAMES = 120
TIME = np.arange(FRAMES) * DT
STILL = np.tile(np.eye(3), (FRAMES, 1, 1))


def about_y(angle):
    """(T,) [rad] -> (T,3,3)."""
    c, s, o, i = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([np.stack([c, o, s], -1), np.stack([o, i, o], -1), np.stack([-s, o, c], -1)], axis=1)


def ring(yaw=None, radius=0.25, count=40):
    """A hem (T,H,3): a slightly oval ring below the root, turned by yaw (T,)."""
    angle = 2 * np.pi * np.arange(count) / count
    shape = np.stack([1.2 * radius * np.sin(angle), np.full(count, -0.2), radius * np.cos(angle)], axis=1)
    return np.einsum("tij,vj->tvi", about_y(np.zeros(FRAMES) if yaw is None else yaw), shape)


@pytest.mark.parametrize(("gain", "lag"), [(1.4, 1.4), (0.8, -2.0)])
def test_a_sine_of_known_gain_and_lag_is_found(gain, lag):
    static = 0.7 * np.sin(2 * np.pi * 1.0 * TIME)
    moving = gain * 0.7 * np.sin(2 * np.pi * 1.0 * (TIME - lag * DT)) + 0.3
    fit = gain_and_lag(moving, static)
    # The lagging signal does not rest before its first frame, as the fit supposes: that costs a few
    # percent.
    assert fit[0] == pytest.approx(gain, rel=0.05)
    assert fit[1] == pytest.approx(lag, abs=0.15)


def test_a_signal_that_starts_at_rest_is_fitted_to_the_last_digit():
    static = np.where(TIME > 1.0, np.sin(2 * np.pi * (TIME - 1.0)), 0.0)
    moving = 1.3 * np.interp(np.arange(FRAMES) - 2.0, np.arange(FRAMES), static)
    assert gain_and_lag(moving, static) == pytest.approx((1.3, 2.0), abs=1e-9)
    assert gain_and_lag(static, static)[1] == 0.0  # and not a round-off of it
    gain, lag = gain_and_lag(0.0 * TIME, static)
    assert gain == 0.0 and np.isnan(lag)  # of what does not move


def test_yaw_of_a_turning_hem_wherever_the_root_turns():
    yaw = 0.8 * np.sin(2 * np.pi * 0.7 * TIME)
    np.testing.assert_allclose(hem_yaw(ring(yaw), STILL), yaw - yaw[0], atol=1e-12)
    root = about_y(0.4 * TIME)
    seen_from_root = np.einsum("tji,tvj->tvi", root, ring(yaw))
    np.testing.assert_allclose(hem_yaw(seen_from_root, root), yaw, atol=1e-12)
    half_turns = hem_yaw(ring(4.0 * TIME), STILL)
    np.testing.assert_allclose(half_turns, 4.0 * TIME, atol=1e-9)  # no jump at pi


def test_response_takes_the_yaw_where_it_turns_and_the_displacement_where_it_shifts():
    lag = 2.0
    yaw = 0.6 * np.sin(2 * np.pi * TIME)
    late = 1.5 * 0.6 * np.sin(2 * np.pi * (TIME - lag * DT))
    assert response(ring(late), ring(yaw), STILL) == pytest.approx((1.5, lag), abs=0.1)
    along = np.array([0.6, 0.0, 0.8])
    shift = 0.05 * np.sin(2 * np.pi * TIME)[:, None, None] * along
    late = 1.5 * 0.05 * np.sin(2 * np.pi * (TIME - lag * DT))[:, None, None] * along
    assert response(ring() + late, ring() + shift, STILL) == pytest.approx((1.5, lag), abs=0.1)
    assert np.isnan(response(ring() + late, ring(), STILL)).all()


def test_amplitude_and_correlation_of_phase_shifted_parts():
    # Three whole periods: sine and cosine are orthogonal.
    whole = 2 * np.pi * 3 * np.arange(FRAMES) / FRAMES
    one = np.sin(whole)[:, None, None] * np.array([1.0, 0.0, 0.0]) * np.ones((1, 7, 1))
    other = 0.5 * np.sin(whole - 0.6)[:, None, None] * np.array([1.0, 0.0, 0.0]) * np.ones((1, 7, 1))
    assert amplitude(other, one) == pytest.approx(0.5)
    assert correlation(other, one) == pytest.approx(np.cos(0.6))
    assert correlation(-one, one) == pytest.approx(-1.0)
    assert np.isnan(correlation(0 * one, one))
    assert np.isnan(amplitude(one, 0 * one))


def a_scene(dynamic=1.0):
    """A hem that turns with the root and lags behind; the root walks, turns, then stops at frame 60."""
    time = np.minimum(TIME, 60 * DT)
    yaw = 0.6 * np.sin(2 * np.pi * time)
    origins = np.stack([0 * time, 0.9 + 0 * time, 1.2 * time], axis=1)
    axes = about_y(yaw)
    after = TIME - 60 * DT
    ringing_yaw = 0.2 * np.exp(-np.maximum(after, 0) / 0.3) * np.cos(2 * np.pi * 1.5 * after)
    lag = dynamic * np.where(after < 0, -0.3 * np.cos(2 * np.pi * TIME), ringing_yaw)
    world, quiet = (ring(turn) + origins[:, None] for turn in (yaw + lag, yaw))
    return axes, origins, world, quiet


def measured(positions, static=None):
    axes, origins, world, quiet = a_scene()
    motion = HemMotion(axes=axes, origins=origins, hem=np.arange(40), simulated=world, quasi_static=quiet)
    return motion.measure(positions, static)


def test_a_share_of_the_dynamics_is_that_share_of_the_amplitude():
    metrics = measured(a_scene(dynamic=0.5)[2])
    assert metrics["dynamics/amplitude"] == pytest.approx(0.5, abs=0.02)
    assert metrics["dynamics/correlation"] > 0.99


def test_solvers_of_the_references_potential_alone_share_its_quasi_static_solution():
    shared = ("simulation", "simulation-1e-8", "simulation-dt/2", "newton-1", "fast-lbfgs-10", "xpbd-10")
    names = ("simulation-springs", "snug+lbfgs-1", "ncs")
    assert all(dynamics.shares_quasi_static(find_method(name)) for name in shared)
    assert not any(dynamics.shares_quasi_static(find_method(name)) for name in names)
    assert not dynamics.shares_quasi_static(MethodEntry(name="mine", description="of a user"))


def test_a_dresser_without_memory_has_none():
    quiet = a_scene()[3]
    shifted = quiet + np.array([0.03, 0.0, 0.0])
    metrics = measured(shifted, static=shifted)
    assert metrics["dynamics/amplitude"] == 0.0
    assert "dynamics/correlation" not in metrics
    assert measured(shifted[:5]) == {}  # too short to say anything
    assert (metrics["dynamics/gain"], metrics["dynamics/lag"]) == pytest.approx((1.0, 0.0), abs=1e-9)


def test_the_hem_of_a_garment_with_legs_is_both_cuffs():
    dressed, motion = tube_dress(), swaying(40)
    left, right = np.array_split(np.arange(AROUND), 2)
    garment = replace(dressed.garment, loops={"left_leg": left, "right_leg": right})
    still = dressed.skin(motion)
    swing = 0.02 * np.sin(2 * np.pi * np.arange(40) / 15)[:, None, None] * still[:1]
    scene = BuiltScene(
        name="legs", cloth=garment.cloth(), energies=(), dt=1 / 30, frames=40, settle=lambda: still[0],
        dressed=Dressed(dressed.body, garment, motion),
    )  # fmt: skip
    group = grouped(scene, {"simulation": still + swing, "fast-lbfgs-10": still + 0.5 * swing})
    group.quasi_static = still
    reference, method = group.roll_outs
    metrics = dynamics.compare(method, reference)
    assert metrics["dynamics/amplitude"] == pytest.approx(0.5)
