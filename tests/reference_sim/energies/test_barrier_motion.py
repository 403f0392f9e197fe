"""Cloth on a barrier: the closed form of rest, and that nothing ever passes through anything.

Whether edges cut faces is asked here with determinants of its own, not with the package under test.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from reference_sim import Cloth, Material, Obstacle, Potential, minimise, simulate
from reference_sim.energies import BendHinge, ContactBarrier, Gravity, StretchStVK
from tests.reference_sim.energies.barriers import assert_free, folded, sheet, still
from tests.reference_sim.meshes import box, grid, sphere

pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier to test")


def equilibrium(barrier: ContactBarrier, pressure: float) -> float:
    """Height [m] of a sheet above a wide face: each vertex has one pair, of a quarter of its area."""

    def push(height: float) -> float:
        s = (height / barrier.distance) ** 2
        slope = -(2 * (s - 1) * np.log(s) + (s - 1) ** 2 / s)
        return -0.25 * barrier.stiffness * slope * 2 * height / barrier.distance

    return brentq(lambda h: push(h) - pressure, 1e-3 * barrier.distance, barrier.distance * (1 - 1e-12))


def test_a_sheet_rests_at_the_height_of_the_formula():
    cloth = sheet(3, 0.1, (0.0, 1e-3, 0.5))  # away from the diagonal of the box
    barrier = ContactBarrier(cloth)
    potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier])
    potential.prepare(still(cloth.rest_positions, Obstacle(*box((-1, -0.1, -1), (1, 0, 1)))))
    result = minimise(potential, cloth.rest_positions)
    height = equilibrium(barrier, cloth.material.areal_density * 9.81)
    assert result.status == "converged"
    assert np.abs(result.positions[:, 1] - height).max() < 1e-8
    push = -barrier.value_and_gradient(result.positions)[1]
    # The weight, up to the gradient's tolerance of a relative residual of 1e-6.
    assert push.sum(axis=0) == pytest.approx([0, 9.81 * cloth.masses.sum(), 0], abs=1e-7)


def test_a_sheet_dropped_on_a_sphere_never_meets_it():
    cloth = sheet(8, 0.26, (-0.127, 0.105, -0.132))
    ball, faces = sphere(3, radius=0.1)
    obstacle = Obstacle(ball, faces)
    barrier = ContactBarrier(cloth)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier]
    thrown = np.tile([0.0, -6.0, 0.0], (cloth.vertex_count, 1))  # a sphere's diameter in one frame
    drop = simulate(cloth, terms, obstacle=obstacle, frames=8, velocity=thrown)
    assert drop.status == "converged", drop.reason
    assert_free(drop, cloth, obstacle)
    assert drop.positions[-1][:, 1].min() < 0.0  # it hangs round the sphere
    assert drop.frame_fields["energy/barrier"][-1] > 0
    again = simulate(cloth, terms, obstacle=obstacle, frames=4, velocity=thrown)
    assert np.array_equal(again.positions, drop.positions[:4])


@pytest.mark.parametrize(("guess", "speed", "frames"), [("body_transported", 0.06, 4), ("previous", 0.02, 3)])
def test_a_rising_sphere_takes_a_sheet_along(guess, speed, frames):
    """`speed` [m] a frame. A guess that stands still leaves all the work to the way there."""
    cloth = sheet(6, 0.24, (-0.12, 0.0, -0.12))
    ball, faces = sphere(3, radius=0.1)
    up = np.array([0.0, 1.0, 0.0])
    obstacle = Obstacle(np.stack([ball + (speed * k - 0.103) * up for k in range(frames)]), faces)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactBarrier(cloth)]
    ride = simulate(cloth, terms, obstacle=obstacle, frames=frames, guess=guess)
    assert ride.status == "converged", ride.reason
    assert_free(ride, cloth, obstacle)
    assert ride.positions[-1][:, 1].max() > speed * (frames - 1)


def test_pins_push_cloth_before_them():
    """A small sheet, all of it pinned, is driven 3 cm a frame down on a free one."""
    x, faces = grid(6, 6, width=0.16, depth=0.16)
    y, more = grid(2, 2, width=0.05, depth=0.05)
    both = np.concatenate([x, y + np.array([0.0531, 4e-3, 0.0547])])
    paddle = np.arange(len(x), len(both))
    cloth = Cloth(both, np.concatenate([faces, more + len(x)]), Material(), pins=paddle)

    def driven(frame: int) -> np.ndarray:
        return both[paddle] - np.array([0, 0.03 * frame, 0])

    terms = [StretchStVK(cloth), BendHinge(cloth), ContactBarrier(cloth)]
    push = simulate(cloth, terms, frames=3, pin_positions=driven)
    assert push.status == "converged", push.reason
    assert_free(push, cloth, None)
    assert np.array_equal(push.positions[-1][paddle], driven(2))
    centre = np.linalg.norm(x - [0.08, 0, 0.08], axis=1) < 0.02
    assert (push.positions[-1][: len(x)][centre, 1] < -0.055).all()


def test_a_folded_sheet_comes_to_rest_on_itself():
    cloth, start = folded(5)
    floor = Obstacle(*box((-1, -0.1, -1), (1.1, 0, 1.2)))
    barrier = ContactBarrier(cloth)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth, acceleration=60.0), barrier]
    rest = simulate(cloth, terms, obstacle=floor, start=start, frames=20)
    assert rest.status == "converged", rest.reason
    assert_free(rest, cloth, floor)
    speed = np.linalg.norm(np.diff(rest.positions[-2:], axis=0), axis=2).max() * 30
    assert speed < 2e-3  # as friction creeps
    x, upper = rest.positions[-1], cloth.rest_positions[:, 0] > 0.13
    assert 2e-3 < x[upper, 1].min() < 6e-3  # on the lower half, which is 2 mm above the floor
    # Of the floor alone nothing reaches it: without self-contact the upper half would fall through the lower.
    alone = ContactBarrier(cloth, self_contact=False)
    alone.prepare(still(x, floor))
    pushed = alone.value_and_gradient(x)[1].any(axis=1)
    assert pushed.any() and not pushed[upper].any()
