"""Minimisers: what they call converged is checked again here by other means; failure is a status."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from reference_sim import GRAVITY, Cloth, Potential, minimise
from reference_sim.energies import BendHinge, Energy, Gravity, Inertia, StretchSpring, StretchStVK
from reference_sim.minimise.descent import STATUSES
from reference_sim.minimise.minimisers import MINIMISERS
from tests.reference_sim.meshes import random_rotation
from tests.reference_sim.minimise.minima import (
    FACES,
    SHEET,
    TOLERANCE,
    assert_minimum,
    free_hessian,
    gradient_by_torch,
    hanging,
)

both = pytest.mark.parametrize("method", MINIMISERS)
SIDES = np.flatnonzero((SHEET[:, 0] == 0) | (SHEET[:, 0] == 0.5))


@both
def test_a_sheet_hangs_from_two_corners(method):
    potential, x0 = hanging()
    before = x0.copy()
    result = minimise(potential, x0, method)
    assert (x0 == before).all()
    assert_minimum(potential, x0, result)
    # The two pins carry the whole weight, minus what the lumped masses of the pins carry themselves.
    carried = gradient_by_torch(potential, result.positions)[potential.cloth.pins]
    assert carried.sum(axis=0) == pytest.approx([0, potential.cloth.masses.sum() * GRAVITY, 0], abs=1e-6)
    assert result.iterations > 0 and result.factorisations > 0
    assert set(result.seconds) >= {"assemble", "factorise", "solve", "evaluate"}
    assert all(seconds >= 0 for seconds in result.seconds.values())


@pytest.mark.parametrize("energies", [(StretchStVK,), (StretchSpring, BendHinge)])
def test_a_flat_compressed_sheet_is_a_saddle_and_not_an_answer(energies):
    """Pressed together between two held sides and flat, it is in balance out of its plane, and unstable."""
    x0 = SHEET * [0.9, 1, 1]
    cloth = Cloth(SHEET, FACES, pins=SIDES)
    potential = Potential([energy(cloth) for energy in energies])
    flat = free_hessian(potential, x0)
    assert np.linalg.eigvalsh(flat)[0] < 0 and (gradient_by_torch(potential, x0)[:, 1] == 0).all()
    result = minimise(potential, x0)
    assert result.status == "stalled" or np.ptp(result.positions[:, 1]) > 0.01
    if result.status == "converged" and BendHinge in energies:
        assert_minimum(potential, x0, result)
    # Flat, the membrane keeps about E2 G^2 / 2 of energy per area; buckled, nearly nothing.
    assert result.energy < 0.05 * potential.value(x0)


@pytest.mark.parametrize("term", [BendHinge, StretchSpring])
@both
def test_a_state_without_energy_is_diverged_and_raises_nothing(method, term):
    """All vertices at one point: a hinge has no normal there, a spring no direction. Or a start of NaN."""
    cloth, torn = Cloth(SHEET, FACES), np.where(np.arange(81)[:, None] == 5, np.nan, SHEET)
    for start in (np.zeros_like(SHEET), torn):
        result = minimise(Potential([term(cloth), Inertia(cloth, 0.01)]), start, method)
        assert result.status == "diverged" and "not finite" in result.reason


class Poisoned(Energy):
    """A term that turns into nan once vertex 40 has fallen by 5 cm."""

    name = "poison"

    def __init__(self, cloth: Cloth) -> None:
        self.cloth, self.stencils = cloth, np.array([[40]])

    def element_energy(self, u):
        return torch.where(u[..., 0, 1] < -0.05, torch.nan, 0.0) + 0 * u[..., 0, 1]


def test_nan_on_the_way_is_never_walked_into_nor_called_converged():
    potential, x0 = hanging()
    potential = Potential([*potential.energies, Poisoned(potential.cloth)])
    result = minimise(potential, x0, max_iterations=20)
    assert result.status in STATUSES and result.status != "converged"
    assert np.isfinite(result.positions).all() and np.isfinite(result.energy)
    assert result.positions[40, 1] >= -0.05


@both
def test_too_few_iterations_is_said(method):
    potential, x0 = hanging()
    options = {} if method == "newton" else {"finish": False}
    result = minimise(potential, x0, method, max_iterations=3, **options)
    assert result.status == "max_iterations" and result.iterations == 3
    assert "3 iterations" in result.reason and result.gradient_norm > TOLERANCE


@pytest.mark.parametrize("rest_angles", [0.0, "rest"])
@both
def test_an_unpinned_cloth_finds_its_rest_shape_somewhere(method, rest_angles):
    """Six rigid motions cost nothing: a singular Hessian at the minimum is no saddle."""
    x = SHEET.copy()
    if rest_angles == "rest":
        x[:, 1] = SHEET[:, 0] ** 2
    cloth = Cloth(x, FACES)
    potential = Potential([StretchStVK(cloth), BendHinge(cloth, rest_angles=rest_angles)])
    x0 = (x + np.random.default_rng(2).normal(0, 0.01, x.shape)) @ random_rotation(3).T + 0.4
    result = minimise(potential, x0, method)
    assert_minimum(potential, x0, result)
    # Nothing pushes or turns an unpinned cloth as a whole: the centre stays up to the solver's shifts.
    centred = result.positions - result.positions.mean(axis=0)
    rest = x - x.mean(axis=0)
    u, _, vt = np.linalg.svd(rest.T @ centred)
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    # A gradient of 1e-6 weights (4e-9 N) over the softest bending mode (1e-4 N/m): 40 micrometres.
    assert np.abs(rest @ turn - centred).max() < 4e-5


@both
def test_at_rest_there_is_nothing_to_do(method):
    cloth = Cloth(SHEET, FACES, pins=SIDES)
    result = minimise(Potential([StretchStVK(cloth), BendHinge(cloth)]), SHEET, method)
    assert result.status == "converged" and result.iterations == 0
    assert np.abs(result.positions - SHEET).max() == 0


def crumpled() -> tuple[Potential, np.ndarray]:
    """A step of a sheet that is far from any minimum: its Hessian is indefinite for a while."""
    cloth = Cloth(SHEET, FACES)
    inertia = Inertia(cloth, 1 / 30)
    x0 = SHEET + np.random.default_rng(5).normal(0, 0.02, SHEET.shape)
    inertia.x_hat = x0
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), inertia]), x0


@pytest.mark.parametrize("case", [hanging, crumpled])
def test_a_factorisation_used_again_saves_others_and_ends_in_a_minimum(case):
    potential, x0 = case()
    fresh, again = minimise(potential, x0), minimise(potential, x0, reuse=True)
    assert_minimum(potential, x0, again)
    # 16 or 18 of 20 where the sheet hangs: that much is round-off.
    assert again.factorisations <= 0.9 * fresh.factorisations and again.iterations > again.factorisations


def test_unknown_names_are_refused():
    potential, x0 = hanging()
    with pytest.raises(ValueError, match=r"unknown minimiser 'bfgs': choose one of newton, lbfgs"):
        minimise(potential, x0, "bfgs")
    with pytest.raises(TypeError, match="tolerence"):
        minimise(potential, x0, tolerence=1e-3)
