"""The column `uncertainty`: the difference between the reference and equally valid simulations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.methods import find_method
from benchmarks.metrics import curvature, dynamics, energy
from benchmarks.metrics import penetration_and_distances as geometry
from benchmarks.metrics.dynamics import HemMotion
from benchmarks.results.protocol import FAMILY, STARTS, noise, trend
from benchmarks.results.row import Row
from benchmarks.runner.measurements import compare_family, measure_roll_out
from benchmarks.runner.rows import with_uncertainty
from tests.benchmarks.runner.tasks_by_hand import grouped, prepared, small_scene

EAST = np.array([1.0, 0.0, 0.0])
TWIN, SMALLER = "simulation-perturbed-1e-4", "simulation-dt/2"


def swaying(scene, frames=6):
    x = np.repeat(scene.start[None], frames, axis=0)
    return x + 0.02 * np.sin(np.arange(frames) + 5.0 * scene.start[:, :1].sum())[:, None, None]


def test_the_uncertainty_of_a_distance_is_what_another_right_simulation_changes():
    scene = small_scene("hanging_sheet", cells=4)
    x = swaying(scene)
    shifts = {
        "simulation": 0.0, TWIN: -0.004, SMALLER: 0.002, "simulation-refrozen": 0.001,
        "simulation-perturbed-1e-9": 0.3, "newton-1": 0.01,
    }  # fmt: skip
    group = grouped(scene, {name: x + shift * EAST for name, shift in shifts.items()})
    metrics = compare_family(group.roll_outs[-1], geometry.compare)
    value, uncertainty, moved = metrics["distance/rms"]
    assert (value, uncertainty) == pytest.approx((10.0, 4.0 / 2.0**0.5))  # a smaller step is no noise
    assert dict(moved) == pytest.approx({TWIN: 4.0, SMALLER: -2.0})
    # A member is compared with the others, not with itself.
    value, uncertainty, moved = compare_family(group.roll_outs[1], geometry.compare)["distance/rms"]
    assert value == pytest.approx(4.0) and np.isnan(uncertainty)
    assert dict(moved) == pytest.approx({SMALLER: 2.0})
    assert compare_family(group.roll_outs[0], geometry.compare) == {}
    alone = grouped(scene, {"simulation": x, "newton-1": x + 0.01 * EAST})
    assert compare_family(alone.roll_outs[1], geometry.compare)["distance/rms"] == pytest.approx(10.0)


def test_the_family_has_two_starts_of_each_time_step():
    steps = {name: find_method(name).options.get("substeps", 1) for name in ("simulation", *FAMILY)}
    shifts = {name: find_method(name).options.get("shift", 0.0) for name in steps}
    pairs = [(count, shift) for count in (1, 2, 4, 8) for shift in (0.0, 1e-4)]
    assert sorted((steps[name], shifts[name]) for name in steps) == pairs
    assert all(steps[one] == steps[two] == count for count, (one, two) in STARTS.items())
    assert noise({TWIN: 3.0}) == pytest.approx(3.0 / 2.0**0.5) and noise({SMALLER: 3.0}) is None
    assert trend({TWIN: 3.0, SMALLER: 1.0}) == {SMALLER: 1.0}


def test_a_start_is_moved_by_its_shift_and_in_no_two_runs_alike():
    scene = small_scene("hanging_sheet", cells=4)
    starts = []
    for name in ("simulation-perturbed-1e-9", "simulation-perturbed-1e-4"):
        level = find_method(name).level
        moved = prepared(name, scene).scene.start - scene.start
        lengths = np.linalg.norm(moved, axis=1)
        assert lengths[scene.cloth.free] == pytest.approx(level, rel=1e-6)
        assert not lengths[scene.cloth.pins].any()
        starts.append(moved / level)
    assert np.abs(starts[0] - starts[1]).max() > 0.1


def test_numbers_of_the_reference_are_as_uncertain_as_its_starts_differ():
    def row(method, metric, value, uncertainty=None):
        entry = find_method(method)
        more = {"role": entry.role, "family": entry.family, "level": entry.level}
        return Row("garments", "tshirt/x", method, 0, metric, "J", value, uncertainty=uncertainty, **more)

    rows = [
        row("simulation", "energy/total", 1.0), row("simulation", "cost/frame", 5.0),
        row("simulation", "gap/energy", 0.1, 0.02), row("snug", "energy/total", 2.0),
        row(TWIN, "energy/total", 0.97), row(TWIN, "cost/frame", 9.0), row(TWIN, "gap/energy", 0.3),
        row(SMALLER, "energy/total", 7.0), row("simulation-1e-8", "energy/total", 5.0),
    ]  # fmt: skip
    uncertain_rows = with_uncertainty(rows)
    spreads = {(r.method, r.metric): r.uncertainty for r in uncertain_rows}
    assert spreads["simulation", "energy/total"] == pytest.approx(0.03 / 2.0**0.5)
    assert dict(uncertain_rows[0].moved) == pytest.approx({TWIN: -0.03, SMALLER: 6.0})
    assert not any(r.moved for r in uncertain_rows[1:])
    assert spreads["simulation", "cost/frame"] is None and spreads["snug", "energy/total"] is None
    assert spreads["simulation", "gap/energy"] == 0.02


def test_means_are_over_the_judged_frames_alone():
    scene = dataclasses.replace(small_scene("hanging_sheet", cells=4), warm_up=3)
    x = swaying(scene)
    wild = x.copy()
    wild[:1] += np.random.default_rng(0).normal(size=x[:1].shape)  # no inertia of frame 3 hangs on it
    one, other = (grouped(scene, {"simulation": x, "newton-1": y}).roll_outs[1] for y in (x, wild))
    for measure in (energy.measure_energy, curvature.measure, geometry.measure):
        assert measure(one) == pytest.approx(measure(other))
    for compare in (curvature.compare, geometry.compare):
        pair = [compare(roll_out, roll_out.reference) for roll_out in (one, other)]
        assert pair[0] == pytest.approx(pair[1])
    late = x.copy()
    late[-1] += 0.1 * np.random.default_rng(0).normal(size=x[0].shape)
    last = grouped(scene, {"simulation": x, "newton-1": late}).roll_outs[1]
    strains = [energy.measure_energy(r)["energy/strain"] for r in (one, last)]
    assert strains[1] > 2.0 * strains[0]
    # What ended in the warm-up has no number.
    ended = grouped(scene, {"newton-1": x[:3]}, suites=("garments",)).roll_outs[0]
    assert measure_roll_out(ended) == ({}, {}, ("ok", ""))


def test_dynamics_are_told_by_the_own_static_answer_and_by_the_simulators(monkeypatch):
    """A method whose static answer moves with it has no dynamics of its own, and half of the simulator's."""
    scene, frames = small_scene("hanging_sheet", cells=4), 40
    time = np.arange(frames)[:, None, None] * scene.dt
    still = np.repeat(scene.start[None], frames, axis=0)
    swing = 0.02 * np.sin(9.0 * time) * scene.start[None, :, :1]
    group = grouped(scene, {"simulation": still + swing, "snug": still + 0.5 * swing})
    reference, method = group.roll_outs
    method.quasi_static = method.positions
    hem = HemMotion(
        axes=np.tile(np.eye(3), (frames, 1, 1)), origins=np.zeros((frames, 3)),
        hem=np.arange(5), simulated=reference.positions, quasi_static=still, first=2,
    )  # fmt: skip
    monkeypatch.setattr(dynamics, "hem_motion", lambda roll_out: hem)
    metrics = dynamics.compare(method, reference)
    assert metrics["dynamics/amplitude"] == 0.0
    assert metrics["dynamics/common_amplitude"] == pytest.approx(0.5)
    assert metrics["dynamics/common_correlation"] == pytest.approx(1.0)
    method.quasi_static = None
    assert "dynamics/amplitude" not in dynamics.compare(method, reference)  # it has none that is known
    method.entry = find_method("newton-2")  # a solver's static answer is the simulator's
    metrics = dynamics.compare(method, reference)
    assert metrics["dynamics/amplitude"] == metrics["dynamics/common_amplitude"] == pytest.approx(0.5)
