"""Sweeps over our own energies: their derivatives are the potential's, and they find what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.meshes import square_sheet
from benchmarks.methods.sweeps import XPBD, VertexBlockDescent, block
from benchmarks.methods.warm_started import SHARE, make_guess
from benchmarks.metrics.energy import first_guess
from benchmarks.scenes.sheets import exact_fall
from reference_sim import Cloth, Material, Potential, simulate
from reference_sim.energies import Gravity, Inertia, Step, StretchStVK
from reference_sim.energies.bend_hinge_kernels import fold
from reference_sim.energies.contact_penalty import sample_depth
from reference_sim.energies.stretch_stvk import strain
from reference_sim.kernels.fast_kernels import SCRATCH_SHAPE, step_terms
from reference_sim.minimise.newton import Newton
from tests.benchmarks.runner.tasks_by_hand import simulated, small_scene
from tests.reference_sim.pressed_sheet import DT, pressed


@pytest.fixture(scope="module")
def touching():
    return pressed(cells=6)


def test_the_block_of_a_vertex_is_that_of_the_potential(touching):
    potential, guess = touching
    x = guess + np.random.default_rng(2).normal(0, 2e-3, guess.shape)
    assert potential.terms(x)["collision"] > 0.0
    inertia, terms = VertexBlockDescent(potential, max_iterations=1).freeze()
    pattern = potential.pattern(np.ones(len(x), dtype=bool))
    convex = pattern.symmetrise(pattern.assemble(x, convexity=1.0)).toarray()
    gradient = potential.gradient(x)
    g, H = np.empty(3), np.empty((3, 3))
    for v in range(len(x)):
        block(x, v, inertia, terms, g, H, np.empty(SCRATCH_SHAPE), np.empty(len(terms)))
        assert g == pytest.approx(gradient[v], abs=1e-12 * np.abs(gradient).max())
        rows = slice(3 * v, 3 * v + 3)
        assert np.abs(H - convex[rows, rows]).max() < 1e-12 * np.abs(convex).max()


def test_the_constraints_of_xpbd_carry_our_energies(touching):
    potential, guess = touching
    x = guess + np.random.default_rng(3).normal(0, 2e-3, guess.shape)
    energies = potential.terms(x)
    data = [constraints.freeze() for constraints in step_terms(potential, "constraint", "XPBD").kernels]
    (faces, inverse, areas, lam, mu, _), hinges, contacts = data
    stiffness = np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, 4 * mu]])
    C = np.array([strain(x, face, D, np.empty(3), np.empty(3)) for face, D in zip(faces, inverse)])
    quadratic = np.einsum("fi,ij,fj->f", C, stiffness, C)
    assert 0.5 * areas @ quadratic == pytest.approx(energies["strain"], rel=1e-12)
    folds = [fold(x, h, rest, np.empty((4, 3))) for h, _, rest in zip(*hinges[:3])]
    k = hinges[1]
    assert 0.5 * k @ np.square(folds) == pytest.approx(energies["bending"], rel=1e-12)
    stencils, shares, k, margin, points, normals, _ = contacts
    planes = zip(stencils, shares, points, normals)
    C = np.array([sample_depth(x, s, w, margin, c, n) ** 1.5 for s, w, c, n in planes])
    assert 0.5 * (2 * k) @ C**2 == pytest.approx(energies["collision"], rel=1e-12)


def test_block_descent_falls_with_every_sweep_to_the_minimum_and_stays_there(touching):
    potential, guess = touching
    best = Newton(potential).minimise(guess)
    values = [potential.value(guess)]
    for sweeps in (1, 2, 4, 16, 64, 1024):
        result = VertexBlockDescent(potential, max_iterations=sweeps).minimise(guess)
        assert result.status == "max_iterations" and result.iterations == sweeps
        assert np.array_equal(result.positions[potential.cloth.pins], guess[potential.cloth.pins])
        values.append(result.energy)
    gaps = (np.array(values) - best.energy) / (values[0] - best.energy)
    assert (np.diff(gaps) < 0).all() and gaps[1] > 0.05 and abs(gaps[-1]) < 1e-6
    again = VertexBlockDescent(potential, max_iterations=5).minimise(best.positions)
    assert np.abs(again.positions - best.positions).max() < 1e-8


@pytest.mark.parametrize("name", ["hanging_sheet", "sheet_on_sphere"])
def test_the_reference_is_where_another_solver_ends_from_another_start(name):
    """Block descent shares neither derivatives nor steps with the simulator; its start is 1 mm away."""
    scene = small_scene(name)
    run = simulated(scene, frames=8)
    potential = Potential([*scene.energies, Inertia(scene.cloth, scene.dt)])
    for frame in (4, 7):
        before, previous, x = run.positions[frame - 2 : frame + 1]
        velocity = (previous - before) / scene.dt
        guess = first_guess(scene, previous, velocity, frame)
        potential.prepare(Step(previous, velocity, guess, scene.dt, scene.obstacle, frame))
        noise = np.random.default_rng(frame).normal(0, 1e-3, x.shape) * scene.cloth.free[:, None]
        reached = VertexBlockDescent(potential, max_iterations=1500).minimise(x + noise)
        energy, to_gain = potential.value(x), potential.value(guess) - potential.value(x)
        assert potential.value(x + noise) - energy > 0.1 * to_gain > 0
        assert abs(reached.energy - energy) < 1e-6 * to_gain
        assert np.abs(reached.positions - x).max() < 1e-5


def test_xpbd_finds_the_minimum_where_its_constraints_are_linear_and_nearly_elsewhere(touching):
    positions, faces = square_sheet(4, 0.2)
    cloth = Cloth(positions, faces, Material(), pins=(0, 4))
    potential = Potential([StretchStVK(cloth), Inertia(cloth, DT)])
    noise = np.random.default_rng(4).normal(size=positions.shape)
    velocity = 1e-6 * noise * [1, 0, 1]  # in the plane, tiny
    velocity[cloth.pins] = 0.0
    guess = positions + DT * velocity
    potential.prepare(Step(positions, velocity, guess, DT))
    best = Newton(potential, tolerance=1e-12).minimise(guess).positions
    reached = XPBD(potential, max_iterations=3000).minimise(guess).positions
    assert np.abs(best - guess).max() > 1e-8  # there was something to do
    assert np.abs(reached - best).max() < 1e-4 * np.abs(best - guess).max()

    potential, guess = touching
    best = Newton(potential).minimise(guess).energy
    to_gain = potential.value(guess) - best
    reached = [XPBD(potential, max_iterations=n).minimise(guess).energy for n in (10, 100, 3000)]
    gaps = [(energy - best) / to_gain for energy in reached]
    assert gaps[0] > gaps[1] > gaps[2] and 1e-6 < gaps[2] < 0.2


@pytest.mark.parametrize("method", [VertexBlockDescent, XPBD])
def test_weight_alone_is_one_sweep_to_the_exact_fall(method):
    positions, faces = square_sheet(3, 0.2)
    cloth = Cloth(positions, faces, Material())
    run = simulate(cloth, [Gravity(cloth)], dt=DT, frames=6, method=method, max_iterations=1)
    assert run.positions == pytest.approx(exact_fall(positions, np.zeros(3), DT, 6), abs=1e-12)


@pytest.mark.parametrize("method", [VertexBlockDescent, XPBD])
def test_a_runaway_is_a_status(method, touching, monkeypatch):
    potential, guess = touching
    nowhere = guess.copy()
    nowhere[10] = np.nan
    inertia = potential.energies[-1]
    monkeypatch.setattr(inertia, "x_hat", nowhere)  # XPBD starts from the prediction
    result = method(potential, max_iterations=3).minimise(nowhere)
    assert result.status == "diverged" and result.reason


def test_given_frames_begin_anew_with_each_run_and_carry_what_the_solver_added_to_the_last():
    frames = np.random.default_rng(0).normal(size=(3, 5, 3))
    added = np.random.default_rng(1).normal(size=(2, 5, 3))

    class Turning:
        def carry(self, residual, frame):
            return frame * residual[:, ::-1]

    plain, carrying = make_guess(lambda: iter(frames)), make_guess(lambda: iter(frames), Turning())
    for _ in range(2):
        for step in (1, 2):
            x = frames[step - 1] + added[step - 1]
            carried = SHARE * step * added[step - 1][:, ::-1]
            assert np.array_equal(plain(step, x), frames[step])
            assert carrying(step, x) == pytest.approx(frames[step] + carried, abs=1e-12)
