"""The loop around the steps of backward Euler: first guesses, pins, files, failures.

The suite `validation` holds the steps to their exact discrete answers: fall, momenta, energy,
oscillations.
"""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from reference_sim import GRAVITY, Cloth, Obstacle, minimise, simulate
from reference_sim.energies import (
    BendHinge,
    ContactFriction,
    ContactPenalty,
    Energy,
    Gravity,
    StretchStVK,
)
from tests.reference_sim.meshes import box, grid

SHEET, FACES = grid(6, 6, width=0.4, depth=0.4)
FREE, HELD = Cloth(SHEET, FACES), Cloth(SHEET, FACES, pins=[0, 6])


def terms_of(cloth: Cloth) -> list[Energy]:
    return [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]


def test_falling_without_velocity_kept_is_a_ladder():
    result = simulate(FREE, terms_of(FREE), frames=11, dt=0.02, quasi_static=True)
    fallen = np.arange(11)[:, None, None] * np.array([0.0, -GRAVITY, 0.0]) * 0.02**2
    # The tolerance allows 1e-6 g dt^2, 4e-9 m a frame.
    assert result.positions == pytest.approx(SHEET + fallen, abs=1e-12)


def test_a_function_as_first_guess_is_asked_at_each_step_and_terms_freeze_there_with_pins_in_place():
    asked, frozen = [], []

    def lifted(step: int, x: np.ndarray) -> np.ndarray:
        asked.append((step, x.copy()))
        return x + 0.01

    class Looking(Gravity):
        def prepare(self, step):
            frozen.append(step.guess.copy())

    terms = [StretchStVK(HELD), Looking(HELD)]
    run = simulate(HELD, terms, frames=3, substeps=2, guess=lifted)
    assert [step for step, _ in asked] == [1, 2, 3, 4] and np.array_equal(asked[2][1], run.positions[1])
    for (_, x), guess in zip(asked, frozen, strict=True):
        assert np.array_equal(guess, np.where(HELD.free[:, None], x + 0.01, SHEET))
    with pytest.raises(ValueError, match=r"guess of step 1 is \(48, 3\): \(49, 3\) \[m\] is due"):
        simulate(HELD, terms, frames=3, guess=lambda step, x: x[1:])


def test_the_record_of_a_run():
    energies = terms_of(HELD)
    result = simulate(HELD, energies, frames=5, dt=0.02)
    assert result.positions.shape == (5, 49, 3) and (result.positions[0] == SHEET).all()
    assert result.times == pytest.approx(0.02 * np.arange(5), rel=1e-15)
    assert (result.frame_seconds[1:] > 0).all() and (result.faces == FACES).all()
    fields = result.frame_fields
    assert all(values.shape == (5,) for values in fields.values())
    assert (fields["converged"] == 1).all() and (fields["gradient_norm"][1:] <= 1e-6).all()
    for energy in energies:
        series = [energy.value_and_gradient(x)[0] for x in result.positions[1:]]
        assert fields[f"energy/{energy.name}"][1:].tolist() == series
    assert set(result.provenance["terms"]) == {"strain", "bending", "gravity", "inertia"}
    assert result.provenance["dt_s"] == 0.02 and result.provenance["guess"] == "extrapolated"


def test_two_runs_give_the_same_bits_also_with_the_same_terms():
    """A term may remember the step before, as lagged friction does; not the run before."""
    contact = ContactPenalty(FREE)
    energies = [*terms_of(FREE), contact, ContactFriction(contact)]
    table = Obstacle(*box((-1, -1, -1), (2, -0.002, 2)))
    pushed = np.tile([1.0, 0.0, 0.0], (len(SHEET), 1))
    runs = [simulate(FREE, energies, obstacle=table, velocity=pushed, frames=8) for _ in range(2)]
    assert runs[0].frame_fields["energy/friction"][-1] > 0
    assert (runs[0].positions == runs[1].positions).all()


def test_divergence_is_recorded_and_not_raised():
    poisoned = simulate(
        FREE, terms_of(FREE), frames=20, guess=lambda step, x: x if step < 4 else np.nan * x
    )
    assert poisoned.status == "diverged" and poisoned.reason.startswith(
        "frame 4: energy or gradient is not"
    )
    assert poisoned.frames == 4 and np.isfinite(poisoned.positions).all()


def test_the_status_of_a_run_is_its_worst_and_the_reason_the_first_with_it():
    frames = iter(["max_iterations", "stalled", "timeout", "max_iterations"])

    def stopping(potential, **options):
        return SimpleNamespace(minimise=lambda x0: replace(minimise(potential, x0), status=next(frames)))

    result = simulate(FREE, terms_of(FREE), frames=5, method=stopping)
    assert result.frames == 5 and not result.frame_fields["converged"][1:].any()
    assert result.status == "timeout" and result.reason.startswith("frame 3: ")
    stopped = simulate(HELD, terms_of(HELD), frames=4, max_iterations=1)
    assert stopped.frames == 4 and stopped.reason == "frame 1: gave up after 1 iterations"


def test_a_step_that_round_off_excuses_says_so_in_its_frame():
    """A million metres away positions have 1e-10 m of round-off, and forces more than 1e-6 weights."""
    result = simulate(HELD, terms_of(HELD), start=SHEET + [1e6, 0.0, 0.0], frames=4)  # noqa: RUF005
    residual, relaxed = (result.frame_fields[name] for name in ("gradient_norm", "relaxed"))
    assert result.status == "converged" and result.frame_fields["converged"].all()
    assert relaxed[1:].all() and (residual[1:] > 1e-6).all()
    assert result.reason.startswith(
        f"frame 1: round-off: residual {residual[1]:.1e} above tolerance 1.0e-06"
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"guess": "body_transported"}, "or give a function; body_transported needs an obstacle"),
        ({"frames": 0}, "frames = 0: must be at least 1"),
        ({"substeps": 0}, "substeps = 0: must be at least 1"),
        ({"start": SHEET[:-1]}, "start is (48, 3): finite numbers (49, 3) are due"),
        ({"pin_positions": lambda _: np.zeros(3)}, "pin_positions(1) is (3,): finite numbers (0, 3)"),
        ({"dt": 0.0}, "dt = 0.0: must be a finite number above 0"),
        ({"tolerance": np.nan}, "tolerance = nan: must be a finite number above 0"),
        ({"method": "bfgs"}, "unknown minimiser 'bfgs': choose one of newton, lbfgs"),
    ],
)
def test_what_cannot_be_simulated_is_refused(options, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        simulate(FREE, terms_of(FREE), **({"frames": 2} | options))


def test_frames_of_sub_steps_are_every_nth_frame_of_small_steps_and_sum_their_work():
    coarse = simulate(HELD, terms_of(HELD), dt=0.06, frames=4, substeps=3)
    fine = simulate(HELD, terms_of(HELD), dt=0.02, frames=10)
    assert coarse.status == fine.status == "converged"
    np.testing.assert_allclose(coarse.positions, fine.positions[::3], atol=1e-12)
    np.testing.assert_allclose(coarse.times, fine.times[::3], rtol=1e-14)
    for name in ("iterations", "factorisations"):
        sums = fine.frame_fields[name][1:].reshape(3, 3).sum(axis=1)
        np.testing.assert_array_equal(coarse.frame_fields[name][1:], sums)
