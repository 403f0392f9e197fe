"""Sub-steps: the same as smaller steps, with pins and obstacle moving evenly in between."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import Cloth, Obstacle, simulate
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, StretchStVK
from reference_sim.minimise.newton import Newton
from reference_sim.time_loop import simulate_with
from reference_sim.time_step import TimeStepper
from tests.reference_sim.meshes import grid, sphere

SHEET, FACES = grid(5, 5, width=0.4, depth=0.4)


def test_frames_of_sub_steps_are_every_nth_frame_of_small_steps_and_sum_their_work():
    cloth = Cloth(SHEET, FACES, pins=[0, 5])
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    coarse = simulate(cloth, terms, dt=0.06, frames=4, substeps=3)
    fine = simulate(cloth, terms, dt=0.02, frames=10)
    assert coarse.status == fine.status == "converged"
    np.testing.assert_allclose(coarse.positions, fine.positions[::3], atol=1e-12)
    np.testing.assert_allclose(coarse.times, fine.times[::3], rtol=1e-14)
    for name in ("iterations", "factorisations"):
        sums = fine.frame_fields[name][1:].reshape(3, 3).sum(axis=1)
        np.testing.assert_array_equal(coarse.frame_fields[name][1:], sums)


def test_pins_arrive_exactly():
    cloth = Cloth(SHEET, FACES, pins=[0, 5])
    places = np.random.default_rng(0).normal(scale=0.01, size=(4, 2, 3)) + SHEET[[0, 5]]
    places[0] = SHEET[[0, 5]]
    moved = simulate(
        cloth, [StretchStVK(cloth)], frames=4, substeps=3, pin_positions=lambda k: places[k], max_iterations=3
    )
    np.testing.assert_array_equal(moved.positions[:, [0, 5]], places)


@pytest.mark.parametrize("place", [np.zeros(3), np.zeros((1, 3)), np.full((2, 3), np.nan)])
def test_pins_of_another_shape_are_refused_and_not_spread(place):
    cloth = Cloth(SHEET, FACES, pins=[0, 5])
    with pytest.raises(ValueError, match=r"pin_positions\(1\) gives .*finite positions \(2, 3\)"):
        simulate(cloth, [StretchStVK(cloth)], frames=2, pin_positions=lambda _: place)


def test_an_obstacle_moves_evenly_between_its_frames():
    ball, faces = sphere(2, 0.2)
    coarse = Obstacle(ball + np.array([[[0, 0, 0]], [[0.3, 0, 0]], [[0.3, 0.6, 0]]]), faces)
    fine = coarse.refined(3)
    assert (coarse.frames, fine.frames, fine.refined(2).frames) == (3, 7, 13)
    moved = np.array([fine.at(k).mean(axis=0) for k in range(9)]) - ball.mean(axis=0)
    x = [0, 0.1, 0.2, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3]
    y = [0, 0, 0, 0, 0.2, 0.4, 0.6, 0.6, 0.6]
    np.testing.assert_allclose(moved, np.transpose([x, y, np.zeros(9)]), atol=1e-12)
    for k in range(3):
        np.testing.assert_array_equal(fine.at(3 * k), coarse.at(k))
    point = np.array([[0.0, 0.5, 0.0]])
    assert coarse.signed_distance(point, 1)[0] == pytest.approx(fine.signed_distance(point, 3)[0])


def test_sub_steps_meet_a_moving_obstacle_as_small_steps_do():
    ball, ball_faces = sphere(3, 0.2)
    cloth = Cloth(SHEET + np.array([-0.2, 0.206, -0.2]), FACES)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactPenalty(cloth)]
    ways = {n: np.stack([ball + np.array([0.0, 0.06 * k / n, 0]) for k in range(4 * n)]) for n in (1, 2)}
    coarse = simulate(
        cloth, terms, dt=0.04, frames=4, substeps=2, obstacle=Obstacle(ways[1], ball_faces), tolerance=1e-9
    )
    fine = simulate(cloth, terms, dt=0.02, frames=7, obstacle=Obstacle(ways[2], ball_faces), tolerance=1e-9)
    np.testing.assert_allclose(coarse.positions, fine.positions[::2], atol=1e-7)
    assert coarse.frame_fields["energy/collision"][-1] > 0


def test_a_minimiser_that_cannot_start_again_is_made_anew_for_the_next_run():
    class Learning:
        def __init__(self, potential, **options):
            self.steps, self.newton = 0, Newton(potential, max_iterations=1)

        def minimise(self, x0):
            self.steps += 1
            return self.newton.minimise(x0 + 1e-3 * self.steps)

    cloth = Cloth(SHEET, FACES)
    stepper = TimeStepper(cloth, [StretchStVK(cloth), Gravity(cloth)], dt=0.02, method=Learning)
    first = simulate_with(stepper, frames=4).positions
    assert not np.array_equal(simulate_with(stepper, frames=4).positions, first)
    stepper.start_again()
    assert np.array_equal(simulate_with(stepper, frames=4).positions, first)
