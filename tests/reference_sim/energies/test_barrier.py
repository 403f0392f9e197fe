"""The barrier alone: derivatives, patterns, line search, refusals."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from reference_sim import Cloth, Material, Obstacle, Potential, minimise, simulate
from reference_sim.energies import (
    BendHinge,
    ContactBarrier,
    Energy,
    Gravity,
    Inertia,
    Step,
    StretchStVK,
)
from reference_sim.material import GRAVITY
from reference_sim.minimise.descent import Result
from reference_sim.minimise.newton import Newton
from reference_sim.time_step import State, TimeStepper
from tests.reference_sim.energies.barriers import cuts, folded, sheet, still
from tests.reference_sim.meshes import box, grid, patch, sphere

pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier to test")


def crumpled(distance: float = 3e-3) -> tuple[ContactBarrier, Obstacle, np.ndarray]:
    """A sheet folded over to 2 mm from itself and 1.5 mm above a rough sphere: pairs of every kind."""
    x, faces = patch(3, cells=6)
    cloth = Cloth(0.1 * x, faces, Material())
    generator = np.random.default_rng(4)
    y = 0.1 * x[:, [0, 2, 1]]  # horizontal
    over = y[:, 0] > 0.05
    y[over] = y[over] * [-1, 1, 1] + [0.1, 2.0e-3, 0.0011]
    y += generator.uniform(-1e-4, 1e-4, y.shape)
    ball, ball_faces = sphere(4, radius=0.2)
    ball += [0.05, -0.2015, 0.05]
    return ContactBarrier(cloth, distance=distance), Obstacle(ball, ball_faces), y


def with_pairs() -> tuple[ContactBarrier, np.ndarray]:
    barrier, obstacle, x = crumpled()
    barrier.prepare(still(x, obstacle))
    kinds = barrier.collisions.pairs(x)[0]
    assert min(map(len, (kinds.fv_collisions, kinds.ee_collisions, kinds.ev_collisions))) > 0
    return barrier, x + np.random.default_rng(5).normal(0, 3e-4, x.shape)


def test_derivatives_are_those_of_finite_differences():
    energy, x = with_pairs()
    gradient, hessian = energy.value_and_gradient(x)[1], energy.sparse_hessian(x)
    assert np.abs(gradient).max() >= 1e-3 and np.abs(hessian.data).max() >= 1.0
    assert abs(hessian - hessian.T).max() <= 1e-12 * np.abs(hessian.data).max()
    h = 1e-9  # [m]: a hundred-thousandth of the smallest distance
    for seed in range(3):
        d = np.random.default_rng(seed).normal(size=x.shape)
        (above, up), (below, down) = (energy.value_and_gradient(x + s * h * d) for s in (1, -1))
        # Half the digits are left of a difference; a wrong factor or sign is far beyond that.
        assert (above - below) / (2 * h) == pytest.approx(np.vdot(gradient, d), rel=1e-4)
        product = (hessian @ d.ravel()).reshape(-1, 3)
        assert np.abs((up - down) / (2 * h) - product).max() <= 1e-4 * np.abs(product).max()


def test_convexity_takes_out_the_negative_curvature_and_nothing_else():
    barrier, x = with_pairs()
    true, half, convex = (barrier.sparse_hessian(x, c).toarray() for c in (0.0, 0.5, 1.0))
    scale = np.abs(true).max()
    assert np.linalg.eigvalsh(true)[0] < -1e-3 * scale
    assert np.linalg.eigvalsh(convex)[0] > -1e-12 * scale
    assert np.linalg.eigvalsh(convex - true)[0] > -1e-12 * scale
    assert np.abs(half - (true + convex) / 2).max() <= 1e-12 * scale


def test_there_is_no_definition_in_torch_and_it_says_so():
    with pytest.raises(NotImplementedError, match="no definition in torch"):
        with_pairs()[0].energy(None)


def test_hessian_of_a_potential_holds_pairs_that_no_other_term_couples():
    barrier, x = with_pairs()
    others: list[Energy] = [StretchStVK(barrier.cloth), BendHinge(barrier.cloth)]
    whole = Potential([*others, barrier]).hessian(x)
    parts = Potential(others).hessian(x) + barrier.sparse_hessian(x)
    assert abs(whole - parts).max() <= 1e-12 * np.abs(whole.data).max()
    assert whole.nnz > Potential(others).hessian(x).nnz


def test_a_wider_pattern_is_kept_while_it_serves():
    barrier, x = with_pairs()
    potential = Potential([StretchStVK(barrier.cloth), barrier])
    fixed = potential.pattern(np.ones(barrier.cloth.vertex_count, dtype=bool))
    wide = fixed.covering(fixed.changing(x))
    assert len(wide.indices) > len(fixed.indices)
    assert wide.covering(wide.changing(x)) is wide
    apart = wide.changing(barrier.cloth.rest_positions)
    assert apart[0].nnz == 0 and wide.covering(apart) is wide and fixed.covering(apart) is fixed
    assert np.array_equal(np.sort(wide.order), np.arange(wide.size))


def test_the_way_of_a_line_search_ends_before_the_first_touch():
    barrier, obstacle, x = crumpled()
    barrier.prepare(still(x, obstacle))
    cloth = barrier.cloth
    for down in (1e-3, 0.01, 0.5):
        direction = np.tile([0.0, -down, 0.0], (len(x), 1))
        share = barrier.largest_step(x, direction)
        assert 0 < share <= 1 and (share == 1) == (down == 1e-3)
        assert not barrier.infeasibility(x + share * direction)
        assert not cuts(x + share * direction, cloth.edges, obstacle.at(0), obstacle.faces).any()
    assert "cuts" in barrier.infeasibility(x - np.array([0, 0.004, 0]))


def test_a_line_search_that_ends_at_the_side_of_the_box_finds_what_is_behind_it():
    """The second step ends at the side of the box, 0.8 mm above a floor that lies outside of it."""
    cloth = sheet(3, 0.1, (0.0, 0.0, 0.0))
    floor = Obstacle(*box((-1, -0.2, -1), (1, -0.0508, 1)))
    barrier, anew = ContactBarrier(cloth), ContactBarrier(cloth)
    y = cloth.rest_positions
    for energy in (barrier, anew):
        energy.prepare(still(y, floor))
    for drop in (0.045, 0.005):
        direction = np.tile([0.0, -drop, 0.0], (cloth.vertex_count, 1))
        y = y + barrier.largest_step(y, direction) * direction
    assert y[:, 1] == pytest.approx(-0.05, abs=1e-12)
    assert barrier.value_and_gradient(y)[0] == pytest.approx(anew.value_and_gradient(y)[0], rel=1e-9)
    assert anew.value_and_gradient(y)[0] > 0.0


def test_a_start_that_intersects_is_refused_by_name():
    cloth = sheet(2, 0.1, (-0.05, 0.0, -0.05))
    ball, faces = sphere(1, radius=0.02)
    terms = [StretchStVK(cloth), Gravity(cloth), ContactBarrier(cloth)]
    message = r"edge \(\d+, \d+\) of the (cloth|body) cuts face \d+ of the (cloth|body)"
    with pytest.raises(ValueError, match=message):
        simulate(cloth, terms, obstacle=Obstacle(ball, faces), frames=2)
    strip, start = folded(5)
    start[strip.rest_positions[:, 0] > 0.11, 1] -= 0.0175  # the upper half, through the lower
    with pytest.raises(ValueError, match=r"edge \(\d+, \d+\) of the cloth cuts face \d+ of the cloth"):
        simulate(strip, [StretchStVK(strip), ContactBarrier(strip)], start=start, frames=2)
    result = minimise(Potential([StretchStVK(strip), ContactBarrier(strip)]), start)
    assert result.status == "diverged" and "of the cloth cuts face" in result.reason


def test_the_elements_named_are_those_that_cut():
    cloth = sheet(2, 0.1, (-0.05, 0.0, -0.05))
    needle, faces = box((0.011, -0.05, 0.013), (0.012, 0.05, 0.014))
    barrier = ContactBarrier(cloth)
    x = cloth.rest_positions
    barrier.prepare(still(x, Obstacle(needle, faces)))
    message = barrier.infeasibility(x)
    names = re.fullmatch(r"edge \((\d+), (\d+)\) of the body cuts face (\d+) of the cloth", message)
    assert names, message
    a, b, face = map(int, names.groups())
    assert cuts(needle, np.array([[a, b]]), x, cloth.faces[face : face + 1]).all()


def a_press() -> tuple[Cloth, Obstacle]:
    """A press that closes wholly, and opens again: between its jaws there is no place for a sheet.

    The sheet reaches out of the jaws, so that it would be cut, not buried.
    """
    cloth = sheet(4, 0.06, (-0.03, 0.01, 0.4))
    low, faces = box((-0.019, -0.05, 0.408), (0.021, 0, 0.449))
    high, _ = box((-0.019, 0.02, 0.408), (0.021, 0.07, 0.449))
    both = np.concatenate([faces, faces + len(low)])
    shut = [0, 0.01, 0.0205, 0.0205, 0.01]
    return cloth, Obstacle(np.stack([np.concatenate([low, high - [0, s, 0]]) for s in shut]), both)


def test_a_body_that_leaves_no_room_stops_and_says_so():
    cloth, press = a_press()
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactBarrier(cloth)]
    pressed = simulate(cloth, terms, obstacle=press, frames=5)
    assert pressed.status == "stalled" and "pins and obstacle came" in pressed.reason
    assert "frame 2" in pressed.reason
    assert list(pressed.frame_fields["converged"][[1, 2, 4]]) == [1, 0, 1]
    assert not cuts(pressed.positions[4], cloth.edges, press.at(4), press.faces).any()


def test_a_body_that_stopped_stays_there_when_the_step_is_frozen_again():
    """Frozen again at the end of its way, it would cut the cloth that it had stopped before."""
    cloth, press = a_press()
    barrier = ContactBarrier(cloth)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier]
    pressed = simulate(cloth, terms, obstacle=press, frames=3, refreeze=1)
    assert pressed.status == "stalled" and not pressed.frame_fields["converged"][2]
    assert barrier.collisions.progress < 1
    assert not barrier.infeasibility(pressed.positions[2])


def test_a_step_that_is_prepared_again_begins_where_the_body_had_stopped():
    cloth, press = a_press()
    barrier, x = ContactBarrier(cloth), cloth.rest_positions
    steps = [Step(x, 0 * x, x, 1 / 30, press, frame) for frame in (2, 3, 3)]
    barrier.prepare(steps[0])
    barrier.set_progress(0.4)
    stopped = barrier.collisions.obstacle_at(0.4)
    for step in steps[1:]:
        barrier.prepare(step)
        assert np.array_equal(barrier.collisions.obstacle_at(0.0), stopped)
        assert np.array_equal(barrier.collisions.obstacle_at(1.0), press.at(3))


class Clocked:
    """Newton's method that says "timeout".

    `rough` counts its minimisations on the way of the obstacle, `work` the iterations of all.
    """

    rough = work = 0

    def __init__(self, potential: Potential, **options) -> None:
        self.newton, self.options = Newton(potential, **options | {"timeout": np.inf}), options

    def minimise(self, x0: np.ndarray) -> Result:
        Clocked.rough += self.options.get("max_iterations") == 8
        result = self.newton.minimise(x0)
        Clocked.work += result.iterations
        return dataclasses.replace(result, status="timeout", reason="gave up")


@pytest.mark.parametrize("timeout", [np.inf, 1e-9])
def test_a_timeout_is_not_hidden_by_a_body_that_stopped_and_ends_its_approach(timeout):
    cloth, press = a_press()
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactBarrier(cloth)]
    stepper = TimeStepper(cloth, terms, dt=1 / 30, obstacle=press, method=Clocked, timeout=timeout)
    state, _ = stepper.advance(1, State(cloth.rest_positions, 0 * cloth.rest_positions), None)
    Clocked.rough = Clocked.work = 0
    _, (result,) = stepper.advance(2, state, None)
    assert result.status == "timeout" and "pins and obstacle came" in result.reason
    assert Clocked.rough == 1 if timeout < 1 else Clocked.rough >= 3
    assert result.iterations == Clocked.work


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"distance": 0.0}, "distance = 0.0: must be a finite number above 0"),
        ({"stiffness": np.nan}, "stiffness = nan: must be"),
        ({"distance": 0.05}, "face 0 is only 0.0236 m high at rest; choose a distance below that"),
    ],
)
def test_impossible_barriers_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        ContactBarrier(sheet(3, 0.1, (0, 0, 0)), **options)


def test_areas_that_weigh_pairs_are_the_rest_state_of_the_cloth():
    x, faces = grid(3, 3, width=0.1, depth=0.1)
    cloth = Cloth(x, faces, Material(), rest_uv=2 * x[:, [0, 2]])
    barrier = ContactBarrier(cloth)
    barrier.prepare(still(x, Obstacle(*box((-1, -0.1, -1), (1, -1e-3, 1)))))
    mesh = barrier.collisions.pairs(x)[1].mesh
    count = cloth.vertex_count
    assert mesh.vertex_areas[:count] == pytest.approx(cloth.vertex_areas, rel=1e-12)
    assert mesh.vertex_areas[count:].max() <= cloth.vertex_areas.mean() * (1 + 1e-12)
    cloth_edges = (mesh.edges < count).all(axis=1)
    assert mesh.edge_areas[cloth_edges].sum() == pytest.approx(cloth.areas.sum(), rel=1e-12)
    assert mesh.edge_areas[~cloth_edges].max() <= mesh.edge_areas[cloth_edges].mean() * (1 + 1e-12)


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(100, 150), marks=pytest.mark.slow)], ids=len)
def test_a_step_that_nobody_chose_ends_free_and_where_it_says(seeds):
    """Material, distance, step and velocities over decades; the gradient by differences of the energy."""
    for seed in seeds:
        random = np.random.default_rng(seed)
        crumple, obstacle, start = crumpled()
        stiffness, hinge = 10 ** random.uniform(-2, 2, 2)
        cloth = Cloth(
            crumple.cloth.rest_positions, crumple.cloth.faces,
            Material(young_modulus=70e3 * stiffness, bending_stiffness=3.96e-5 * hinge),
        )  # fmt: skip
        dt = 10 ** random.uniform(-3, -0.5)
        barrier = ContactBarrier(cloth, distance=10 ** random.uniform(-3, -2.3))
        terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier, Inertia(cloth, dt)]
        potential = Potential(terms)
        velocity = 10 ** random.uniform(-2, 1) * random.normal(size=start.shape)
        potential.prepare(Step(start, velocity, start, dt, obstacle, 1))
        potential.set_progress(1.0)
        result = minimise(potential, start, timeout=20.0)
        x, body = result.positions, obstacle.at(1)
        assert not cuts(x, cloth.edges, x, cloth.faces).any(), seed
        assert not cuts(x, cloth.edges, body, obstacle.faces).any(), seed
        assert result.status in ("converged", "stalled", "max_iterations", "timeout") and result.reason
        if result.status == "converged":
            residual = 1e-6 * cloth.masses.mean() * GRAVITY
            for _ in range(12):
                d = random.uniform(-1, 1, x.shape)
                coarse, fine = (_slope(potential, x, d, h) for h in (2e-8, 1e-8))
                noise = 4e-7 * sum(map(abs, potential.terms(x).values())) + 4 * abs(coarse - fine)
                assert abs(fine) <= residual * np.abs(d).sum() + noise, seed


def _slope(potential: Potential, x: np.ndarray, d: np.ndarray, h: float) -> float:
    return (potential.value(x + h * d) - potential.value(x - h * d)) / (2 * h)
