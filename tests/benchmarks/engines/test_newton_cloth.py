"""newton's solvers: they are given our cloth, and descend the energies that we say they do."""

from __future__ import annotations

import dataclasses
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.engines.newton_cloth import NewtonCloth, build_model, spring_stiffness
from benchmarks.engines.newton_energies import StableNeoHookean, UnequalSprings
from benchmarks.methods.solvers import newton_physics
from benchmarks.performance.microbenchmarks import DT, regular_sheet
from reference_sim import Potential, simulate
from reference_sim.energies import BendHinge, Gravity, Inertia, Step, StretchStVK
from reference_sim.minimise.newton import Newton
from tests.benchmarks.runner.tasks_by_hand import small_scene


def test_stable_neo_hookean_meets_its_closed_form_and_stvk_at_rest():
    cloth = regular_sheet(4)
    theirs, ours = StableNeoHookean(cloth), StretchStVK(cloth)
    x = cloth.rest_positions
    value, gradient = theirs.value_and_gradient(x)
    assert abs(value) < 1e-14 and np.abs(gradient).max() < 1e-13
    # Second derivatives at rest make the mapping tri_ke = mu, tri_ka = lambda what it is.
    assert theirs.hessian_blocks(x) == pytest.approx(ours.hessian_blocks(x), rel=1e-12, abs=1e-12)
    s, t, mu, L = 1.3, 0.8, theirs.mu, theirs.lam + theirs.mu
    a = 1 + mu / L
    by_hand = mu / 2 * (s**2 + t**2 - 2) + L / 2 * ((s * t - a) ** 2 - (1 - a) ** 2)
    assert theirs.value_and_gradient(x * [s, 1, t])[0] == pytest.approx(by_hand, rel=1e-13)


def test_springs_have_the_stiffness_of_the_area_around_them():
    cloth = regular_sheet(4)
    k = spring_stiffness(cloth) / cloth.material.membrane_modulus
    ends = cloth.rest_positions[cloth.edges]
    middle = ends.mean(axis=1)
    diagonal = (np.abs(ends[:, 1] - ends[:, 0]) > 1e-9).sum(axis=1) == 2
    border = ~diagonal & ((np.abs(middle[:, [0, 2]] - 0.5) > 0.49).any(axis=1))
    assert k[diagonal] == pytest.approx(0.5) and k[border] == pytest.approx(0.5)
    assert k[~diagonal & ~border] == pytest.approx(1.0)
    springs = UnequalSprings(cloth)
    value = springs.value_and_gradient(1.1 * cloth.rest_positions)[0]
    assert value == pytest.approx(0.005 * (springs.stiffness * cloth.edge_lengths**2).sum(), rel=1e-12)


@pytest.mark.parametrize("solver", ["VBD", "XPBD"])
def test_newton_is_given_our_cloth(solver):
    pytest.importorskip("newton", reason="needs the extra `engines`")
    cloth = regular_sheet(5)
    model = build_model(cloth, solver)
    free = np.setdiff1d(np.arange(cloth.vertex_count), cloth.pins)
    mass = model.particle_mass.numpy()
    assert mass[free] == pytest.approx(cloth.masses[free], rel=1e-6) and (mass[cloth.pins] == 0).all()
    assert model.gravity.numpy().ravel()[:3] == pytest.approx([0, -9.81, 0])
    assert model.tri_areas.numpy() == pytest.approx(cloth.areas, rel=1e-5)
    lame = [cloth.material.lame_mu, cloth.material.lame_lambda, 0, 0, 0]
    assert model.tri_materials.numpy() == pytest.approx(np.tile(lame, (len(cloth.faces), 1)), rel=1e-6)
    edges, ke = model.edge_indices.numpy(), model.edge_bending_properties.numpy()[:, 0]
    inner = (edges >= 0).all(axis=1)
    assert inner.sum() == len(cloth.hinges) and (ke[~inner] == 0).all()
    length = np.linalg.norm(np.diff(cloth.rest_positions[edges[inner, 2:]], axis=1)[:, 0], axis=1)
    two_areas = 2 * cloth.areas.mean()
    over = length if solver == "VBD" else two_areas
    stiffness = cloth.material.bending_stiffness * length**2 / (4 * two_areas)
    assert ke[inner] * over == pytest.approx(stiffness, rel=1e-5)
    if solver == "XPBD":
        assert model.spring_count == len(cloth.edges)
        assert model.spring_stiffness.numpy() == pytest.approx(spring_stiffness(cloth), rel=1e-6)


@pytest.mark.slow  # newton compiles its kernels at first use
@pytest.mark.parametrize(
    "solver, energy, iterations, dt",
    [("VBD", StableNeoHookean, 1000, DT), ("XPBD", UnequalSprings, 300, DT / 16)],
    ids=["VBD", "XPBD"],
)
def test_newton_descends_the_energy_that_we_say_it_does(solver, energy, iterations, dt):
    """Many iterations of one step end within float32 of the minimum that our Newton finds in float64."""
    pytest.importorskip("newton", reason="needs the extra `engines`")
    cloth = regular_sheet(6)
    start = cloth.rest_positions + np.random.default_rng(0).normal(0, 1e-4, cloth.rest_positions.shape)
    start[cloth.pins] = cloth.rest_positions[cloth.pins]
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    fallen = simulate(cloth, terms, dt=DT, frames=9, start=start).positions
    x, v = (a.astype(np.float32).astype(np.float64) for a in (fallen[-1], (fallen[-1] - fallen[-2]) / DT))
    potential = Potential([energy(cloth), BendHinge(cloth), Gravity(cloth), Inertia(cloth, dt)])
    guess = x + dt * v
    potential.prepare(Step(x, v, guess, dt))
    lowest = Newton(potential, max_iterations=100).minimise(guess).energy
    positions, _ = NewtonCloth(cloth, solver, iterations=iterations).advance(x, v, dt)
    assert (positions[cloth.pins] == x[cloth.pins]).all()
    assert 0 <= potential.value(positions) - lowest + 1e-12 < 1e-5 * (potential.value(guess) - lowest)


def test_pins_move_evenly_over_the_sub_steps_of_a_frame(monkeypatch):
    """The solver is a fake that moves nothing, so it is tested without newton too."""
    seen = []

    class Still:
        def __init__(self, cloth, solver, iterations):
            pass

        def advance(self, x, v, dt):
            seen.append(x[scene.cloth.pins].copy())
            return x.copy(), v

    scene = small_scene("hanging_sheet", frames=3)
    handles, up = scene.start[scene.cloth.pins], np.array([0.0, 0.1, 0.0])
    scene = dataclasses.replace(scene, pin_positions=lambda frame: handles + frame * up)
    monkeypatch.setattr(newton_physics, "NewtonCloth", Still)
    monkeypatch.setitem(sys.modules, "newton", SimpleNamespace(__version__="fake"))
    method = newton_physics.make(models=None, seed=0, solver="VBD", iterations=1, substeps=4)
    method.prepare(scene)
    seen.clear()
    trajectory = method.run()
    risen = np.array(seen)[:, 0, 1] - handles[0, 1]
    assert risen == pytest.approx(0.025 * np.arange(1, 9))
    for frame in (1, 2):
        assert np.array_equal(trajectory.positions[frame][scene.cloth.pins], scene.pin_positions(frame))
