"""Terms refuse numbers without a sense, and definitions that would inherit another's derivatives."""

from __future__ import annotations

import re

import numpy as np
import pytest

from reference_sim import Cloth
from reference_sim.energies import (
    AreaBarrier,
    ContactFriction,
    ContactPenalty,
    Energy,
    Inertia,
    StretchStVK,
)
from tests.reference_sim.meshes import grid

SHEET = Cloth(*grid(3, 3, width=0.1, depth=0.1))


@pytest.mark.parametrize(
    "make",
    [
        lambda cloth: ContactPenalty(cloth, margin=float("nan")),
        lambda cloth: ContactPenalty(cloth, per_sample_stiffness=float("inf")),
        lambda cloth: ContactFriction(ContactPenalty(cloth), speed=0.0),
        lambda cloth: AreaBarrier(cloth, threshold=float("nan")),
        lambda cloth: Inertia(cloth, float("inf")),
    ],
)
def test_numbers_that_would_push_or_do_nothing_are_refused(make):
    with pytest.raises(ValueError, match=r"must be a finite number"):
        make(SHEET)


@pytest.mark.parametrize("parent", [StretchStVK, ContactPenalty])
def test_another_definition_states_where_its_derivatives_come_from(parent):
    bent = SHEET.rest_positions + 0.01 * np.sin(40 * SHEET.rest_positions[:, [1, 2, 0]])

    def halved(self, u):
        return 0.5 * parent.element_energy(self, u)

    with pytest.raises(
        TypeError, match=r"Half would inherit closed forms of another energy: write "
    ) as told:
        type("Half", (parent,), {"element_energy": halved})
    lines = re.findall(r"(\w+) = Energy\.(\w+)", str(told.value))
    Half = type(
        "Half", (parent,), {"element_energy": halved, **{a: getattr(Energy, b) for a, b in lines}}
    )
    whole, half = parent(SHEET), Half(SHEET)
    if parent is ContactPenalty:
        whole.points = half.points = whole.sample_matrix @ bent + [0.0, 1e-3, 0.0]
    value, gradient = half.value_and_gradient(bent)
    assert value == pytest.approx(0.5 * whole.value_and_gradient(bent)[0]) and value > 0
    np.testing.assert_allclose(gradient, 0.5 * whole.value_and_gradient(bent)[1], atol=1e-12)
