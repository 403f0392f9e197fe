"""Friction is judged as it was minimised: at any frame, of any trajectory, whatever was judged before."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.metrics.energy import copy_terms, freeze_step
from benchmarks.metrics.energy_gap import optimality
from benchmarks.scene import BuiltScene
from reference_sim import Cloth, Obstacle, Potential, Trajectory, simulate
from reference_sim.energies import ContactFriction, ContactPenalty, Gravity, Step, StretchStVK
from tests.reference_sim.meshes import box, grid

FRAMES = 12
ANGLE = 0.7  # [rad]: tan is 0.84, a sheet slides
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])


def on_a_belt() -> BuiltScene:
    """A jagged sheet on a slope whose skin moves across the way down at 0.3 m/s."""
    flat, faces = grid(4, 4, width=0.2, depth=0.2)
    cloth = Cloth(flat, faces)
    corners, sides = box((-2, -0.1, -1), (1, 0, 2))
    across = np.array([0.0, 0.0, 0.01]) * np.arange(FRAMES)[:, None, None]
    penalty = ContactPenalty(cloth)
    noise = np.random.default_rng(0).uniform(0.0, 5e-4, len(flat))
    start = (flat + np.stack([0 * noise, 1.5e-3 + noise, 0 * noise], axis=1)) @ TURN.T
    terms = (StretchStVK(cloth), Gravity(cloth), penalty, ContactFriction(penalty))
    return BuiltScene(
        name="belt", cloth=cloth, energies=terms, dt=1 / 30, frames=FRAMES, settle=lambda: start,
        obstacle=Obstacle((corners + across) @ TURN.T, sides),
    )  # fmt: skip


@pytest.fixture(scope="module")
def judged() -> tuple[BuiltScene, Trajectory]:
    scene = on_a_belt()
    trajectory = simulate(
        scene.cloth, scene.energies, frames=FRAMES, obstacle=scene.obstacle, start=scene.start
    )
    assert trajectory.status == "converged", trajectory.reason
    assert (trajectory.frame_fields["energy/friction"][-4:] > 1e-6).all()
    return scene, trajectory


def test_the_simulation_ends_each_step_in_its_minimum_also_where_frames_are_jumped(judged):
    """Frames are taken from all over the trajectory in turn, and again with planes at the frame itself."""
    scene, trajectory = judged
    optimum = optimality(scene, trajectory.positions, samples=FRAMES)
    gradients = optimum.values["gradient/norm"]
    assert len(gradients) == len(optimum.values["gap/refrozen"]) == FRAMES - 2 and max(gradients) <= 1e-6
    assert max(optimum.values["gap/local"]) <= 1e-12


def test_a_jumped_to_frame_has_the_friction_of_all_steps_in_a_row(judged):
    scene, trajectory = judged
    x, frame = trajectory.positions, FRAMES - 3
    jump, row = Potential(copy_terms(scene)), Potential(copy_terms(scene))
    freeze_step(scene, jump, x, 4)  # a frame of before, far from this one
    guess = freeze_step(scene, jump, x, frame)
    for t in range(1, frame + 1):
        last = freeze_step(scene, row, x, t)
    assert np.array_equal(guess, last)
    at = np.ascontiguousarray(x[frame])
    assert jump.terms(at) == row.terms(at) and jump.terms(at)["friction"] > 0
    assert not np.shares_memory(jump.gradient(at), row.gradient(at))


def test_friction_without_the_step_before_is_refused():
    """A step may be prepared alone, since that after it needs no more; it has no energy."""
    scene = on_a_belt()
    x = scene.start
    contact, friction = scene.energies[2:]

    def value(frame: int, obstacle: Obstacle) -> float:
        step = Step(x, 0 * x, x, scene.dt, obstacle, frame)
        contact.prepare(step)
        friction.prepare(step)
        return friction.value_and_gradient(x)[0]

    belt = scene.obstacle
    for frame, obstacle, accepted in (
        (5, belt, False), (6, belt, True), (8, belt, False), (9, belt.refine(2), False), (1, belt, True),
    ):  # fmt: skip
        if accepted:
            assert value(frame, obstacle) > 0
        else:
            with pytest.raises(ValueError, match="step of the frame before"):
                value(frame, obstacle)
