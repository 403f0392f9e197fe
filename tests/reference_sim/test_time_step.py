"""Sub-steps: the same as smaller steps, with pins and obstacle moving evenly in between."""

from __future__ import annotations

import numpy as np

from reference_sim import Cloth, simulate
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from reference_sim.minimise.newton import Newton
from reference_sim.time_loop import simulate_with
from reference_sim.time_step import TimeStepper
from tests.reference_sim.meshes import grid

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
