"""Which energies a method's excess consists of."""

from __future__ import annotations

import pytest

from reports.text.excess_terms import excess_terms
from tests.reports.report_folder import row, run_of

ENERGIES = {
    "simulation": {"strain": 1.0, "collision": 0.5, "inertia": 0.2},
    "snug": {"strain": 2.5, "collision": 4.0, "inertia": 0.201},
}


def test_the_terms_of_an_excess_stand_by_size_and_small_ones_are_not_named():
    rows = [
        row(scene, method, f"energy/{term}", value, terms="strain+collision+inertia")
        for scene in ("tshirt/a", "tshirt/b")
        for method, terms in ENERGIES.items()
        for term, value in (terms | {"total": sum(terms.values())}).items()
    ]
    text = excess_terms(run_of(rows), "snug").replace("\u00a0", " ")
    assert text == "The mean energy of SNUG above the reference's, 5.00 J, is 70 % collision and 30 % strain."
    with pytest.raises(ValueError, match="no total energy of pbns"):
        excess_terms(run_of(rows), "pbns")
