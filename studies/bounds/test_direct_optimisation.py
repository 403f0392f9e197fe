"""Direct optimisation minimises exactly the sum that judges every method, and no method is below it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from benchmarks.assets import open_assets
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from direct_optimisation import ClipInertia, DirectOptimisation
from reference_sim.cloth import Cloth
from reference_sim.energies import ContactPenalty, Inertia
from tests.benchmarks.runner.tasks_by_hand import dressed_scene, prepared
from tests.snug.training.dressing import swaying, tube_dress

FRAMES = 6


@pytest.fixture(scope="module")
def scene():
    """A T-shirt: what no shoulder holds falls without end, and has no bound."""
    preset = dataclasses.replace(find_preset("smoke"), frames=FRAMES)
    assets = open_assets(preset, [swaying(FRAMES)], ["tshirt"])
    return dataclasses.replace(dressed_scene("sway", preset=preset).build(assets), origin_heights=None)


@pytest.fixture(scope="module")
def bound(scene):
    method = DirectOptimisation()
    method.prepare(scene)
    return method, method.run()


def test_inertia_of_a_clip_is_the_sum_over_its_frames():
    one = tube_dress().cloth
    apart = 9.0 * np.arange(FRAMES)[:, None, None] * [1.0, 0.0, 0.0]
    faces = one.faces + one.vertex_count * np.arange(FRAMES)[:, None, None]
    clip = Cloth((one.rest_positions + apart).reshape(-1, 3), faces.reshape(-1, 3))
    term, x = ClipInertia(clip, 1 / 30, FRAMES), np.random.default_rng(0).normal(size=(FRAMES, 150, 3))
    value, gradient = term.value_and_gradient(x.reshape(-1, 3))
    single = Inertia(one, 1 / 30)
    y = torch.as_tensor(x)
    parts = [float(single.energy(y[t], 2 * y[t - 1] - y[t - 2]).sum()) for t in range(2, FRAMES)]
    assert value == pytest.approx(sum(parts), rel=1e-12)
    step = np.random.default_rng(1).normal(size=gradient.shape)
    ends = [term.value_and_gradient(x.reshape(-1, 3) + h * step)[0] for h in (1e-3, -1e-3)]
    assert np.vdot(gradient, step) == pytest.approx((ends[0] - ends[1]) / 2e-3, rel=1e-9)
    # The stand-in is the true diagonal: what a vertex feels of its own motion alone.
    diagonal = term.scalar_stiffness(x)[1].ravel()
    for vertex in (0, 150, 300, 899):
        unit = np.zeros((FRAMES * 150, 3))
        unit[vertex, 0] = 1.0
        assert diagonal[vertex] == pytest.approx(2 * term.value_and_gradient(unit)[0], rel=1e-12)


def test_the_sum_is_that_of_the_energy_metric(scene, bound):
    """At the same vertices and with planes searched there, term by term and frame by frame."""
    method, trajectory = bound
    x = trajectory.positions
    method.search(x.reshape(-1, 3))
    series = energy_series(scene, [x])[0]
    for term in method.terms:
        here = term.value_and_gradient(x.reshape(-1, 3))[0]
        assert here == pytest.approx(series[term.name].sum(), rel=1e-9, abs=1e-12), term.name


def test_the_bound_is_far_below_skinning_and_below_a_simulation(scene, bound):
    _, trajectory = bound
    clips = (trajectory.positions, prepared("simulation", scene).run().positions, scene.skinned)
    free, reference, start = (s["total"].sum() for s in energy_series(scene, clips))
    assert trajectory.status == "ok" and trajectory.positions.shape == scene.skinned.shape
    assert free < reference < start
    sums = trajectory.provenance["sums_J"]
    assert len(sums) > 1 and sums[-1] < sums[0]


def test_a_bound_that_still_falls_is_no_bound_yet(scene, bound, monkeypatch):
    assert bound[1].status == "ok"
    monkeypatch.setattr("direct_optimisation.ROUNDS", 1)
    monkeypatch.setattr("direct_optimisation.ITERATIONS", 2)
    method = DirectOptimisation()
    method.prepare(scene)
    trajectory = method.run()
    assert trajectory.status == "stalled" and "still falling after 1 rounds" in trajectory.reason


def test_terms_that_it_does_not_minimise_are_refused(scene):
    stiff = (*scene.energies[:-1], ContactPenalty(scene.cloth, margin=0.01))
    for other in (scene.energies[:-1], stiff):
        with pytest.raises(ValueError, match="minimises the paper's terms"):
            DirectOptimisation().prepare(dataclasses.replace(scene, energies=other))


def test_the_height_of_the_pelvis_counts_for_no_fall(scene):
    heights = np.linspace(0.9, 1.1, FRAMES)
    method = DirectOptimisation()
    method.prepare(dataclasses.replace(scene, origin_heights=heights))
    assert method.carried == pytest.approx(9.81 * scene.cloth.masses.sum() * heights.sum())
    method.prepare(scene)
    assert method.carried == 0.0
