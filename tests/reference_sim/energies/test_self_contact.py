"""Self-contact alone, beside another term for the body: known answers, and that it changes nothing elsewhere.

Whether edges cut faces is asked here with determinants of its own, not with the package under test.
"""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import Cloth, Material, Obstacle, simulate
from reference_sim.energies import BendHinge, ContactBarrier, ContactPenalty, Gravity, StretchStVK
from reference_sim.minimise.newton import Newton
from tests.reference_sim.energies.barriers import assert_free, cuts, folded, sheet
from tests.reference_sim.meshes import box, grid

pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier to test")


def self_contact(cloth: Cloth) -> ContactBarrier:
    return ContactBarrier(cloth, distance=1e-3, obstacle=False)


def two_sheets() -> tuple[Cloth, int]:
    """A sheet that is held, and one 3 mm above it, not vertex over vertex; the number of vertices held."""
    x, faces = grid(4, 4, width=0.08, depth=0.08)
    y, more = grid(3, 3, width=0.05, depth=0.05)
    both = np.concatenate([x, y + np.array([0.0131, 3e-3, 0.0147])])
    return Cloth(both, np.concatenate([faces, more + len(x)]), Material(), pins=np.arange(len(x))), len(x)


@pytest.mark.parametrize("held", [True, False])
def test_a_sheet_pressed_on_another_keeps_a_gap_and_its_weight_is_carried(held):
    """The barrier pushes up as much as the sheet weighs; without it the sheet falls freely."""
    cloth, lower = two_sheets()
    weight = Gravity(cloth, acceleration=40.0)
    barrier = self_contact(cloth)
    terms = [StretchStVK(cloth), BendHinge(cloth), weight, *([barrier] if held else [])]
    fall = simulate(cloth, terms, frames=6, quasi_static=True)
    assert fall.status == "converged", fall.reason
    x = fall.positions[-1]
    if not held:
        assert x[lower:, 1].max() < -0.1
        return
    assert_free(fall, cloth, None)
    push = barrier.value_and_gradient(x)[1][lower:]
    assert -push.sum(axis=0)[1] == pytest.approx(40.0 * cloth.masses[lower:].sum(), rel=1e-3)
    assert x[lower:, 1].min() > 0 and x[lower:, 1].max() < 1e-3  # the barrier reaches 1 mm


@pytest.mark.parametrize("apart", [True, False])
def test_a_folded_strip_on_a_floor_of_penalty_comes_to_rest_on_itself(apart):
    cloth, start = folded(5)
    floor = Obstacle(*box((-1, -0.1, -1), (1.1, 0, 1.2)))
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth, acceleration=60.0), ContactPenalty(cloth)]
    rest = simulate(
        cloth, [*terms, *([self_contact(cloth)] if apart else [])], obstacle=floor, start=start, frames=15
    )
    assert rest.status == "converged", rest.reason
    if apart:
        assert_free(rest, cloth, None)
    else:
        assert any(cuts(x, cloth.edges, x, cloth.faces).any() for x in rest.positions)


def test_frames_in_which_nothing_is_near_are_those_without_it():
    cloth = sheet(4, 0.2, (0.0, 0.0, 0.0), pins=[0, 4])
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    without = simulate(cloth, terms, frames=5)
    beside = simulate(cloth, [*terms, self_contact(cloth)], frames=5)
    assert np.array_equal(without.positions, beside.positions)
    assert list(beside.frame_fields["energy/barrier"][1:]) == [0.0] * 4


def test_a_step_counts_the_iterations_without_late_terms_too(monkeypatch):
    """Where the sheet comes near the other, an opening without the barrier is followed by one with it."""
    work = []
    minimise = Newton.minimise

    def counted(newton, *args, **options):
        result = minimise(newton, *args, **options)
        work.append(result.iterations)
        return result

    monkeypatch.setattr(Newton, "minimise", counted)
    cloth, _ = two_sheets()
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth, acceleration=40.0), self_contact(cloth)]
    fall = simulate(cloth, terms, frames=4, quasi_static=True, method="newton")
    assert len(work) > 3 and fall.frame_fields["iterations"].sum() == sum(work)


def test_a_run_tells_how_steps_were_opened():
    """L-BFGS begins the steps by default, Newton's method if it is asked for; it ends them either way."""
    cloth = sheet(4, 0.2, (0.0, 0.0, 0.0), pins=[0, 4])
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    by_default = simulate(cloth, [*terms, self_contact(cloth)], frames=3)
    by_newton = simulate(cloth, [*terms, self_contact(cloth)], frames=3, method="newton")
    assert not np.array_equal(by_default.positions, by_newton.positions)
    assert (by_default.provenance["opening"], by_newton.provenance["opening"]) == ("lbfgs", "newton")
    assert "opening" not in simulate(cloth, terms, frames=1).provenance


def test_a_barrier_against_nothing_is_refused():
    strip, _ = folded(5)
    with pytest.raises(ValueError, match="meets nothing: give self_contact=True or obstacle=True"):
        ContactBarrier(strip, self_contact=False, obstacle=False)


def test_a_function_as_method_is_refused_where_newtons_method_would_end_its_steps():
    cloth, _ = two_sheets()
    terms = [StretchStVK(cloth), Gravity(cloth), self_contact(cloth)]
    with pytest.raises(ValueError, match="not a function, ends steps that 'barrier' joins: choose"):
        simulate(cloth, terms, frames=2, method=lambda potential, **options: Newton(potential))
