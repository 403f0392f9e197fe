"""Tables of the audit of engines."""

from __future__ import annotations

import pytest

from reports.tables.engines.audit import engine_audit, engine_laws
from tests.reports.report_folder import row, run_of


def test_violations_and_the_cost_of_the_limit_stand_in_one_line():
    def of(scene, law, value, **more):
        return row(scene, "e", f"engine/{law}", value, suite="engines", unit="1", role="", **more)

    judged = {"expected": 1.0, "tolerance": 0.01}
    rows = [
        of("e", "fall_over_discrete_law", 0.5, **judged),
        of("e", "reaction_over_weight", 1.005, **judged),
        of("e/x1", "distance", 3.0, expected=0.0, tolerance=1.0),
        of("e/x1", "time", 2.0),
        of("e/x4", "time", 8.0),
        of("e", "budget", 4.0),
        of("e", "reference_time", 6.0),
    ]
    (audit,), (laws,) = engine_audit(run_of(rows)), engine_laws(run_of(rows))
    assert audit.rows == (("e", "free fall, own limit, 3 not measured", 2.0, 3.0, 4.0, 8.0, 6.0),)
    assert laws.rows[0][1] == pytest.approx(-50.0) and laws.rows[0][4] == pytest.approx(0.5)
