"""Tables of suite speed: rivals, uncertainty of the reference."""

from __future__ import annotations

import pytest

from reports.tables import make_tables
from reports.tables.page_one import error_rivals, reference_uncertainty
from tests.reports.report_folder import run_of
from tests.reports.speed_rows import SCENES, all_rows, row


def test_a_table_says_what_beats_the_network():
    run = run_of(all_rows())
    (table,) = error_rivals(run)
    assert table.rows == (
        ("Energy gap", 0.1, 0.25, "", None, None, "lbfgs-20", 16.0),
        ("Curvature error [1/m]", 5.0, 0.25, "skinning", 4.5, 0.1, "lbfgs-5", 4.0),
    )


def test_the_reference_has_its_uncertainty_and_its_error_in_time_in_a_table():
    more = {"role": "reference-variant", "family": "simulation-dt", "level": 4.0}
    rows = [row(SCENES[0], "simulation-dt-4", "distance/rms", 30.0, "mm", **more)]
    energies = {"simulation": 1.0, "skinning": 5.0, "snug": 2.0, "simulation-dt-4": 1.4}
    of_finer = {"simulation-dt-4": more}
    rows += [row(SCENES[0], m, "energy/total", e, "J", **of_finer.get(m, {})) for m, e in energies.items()]
    (table,) = reference_uncertainty(run_of(all_rows() + rows))
    excesses = [f"excess_{scene}" for scene in SCENES]
    assert [column.name for column in table.columns] == ["of", *excesses, "curvature/error", "distance/rms"]
    assert table.rows == (
        ("ensemble of the reference, root mean square", None, None, None, 21.0),
        ("4 steps a frame", pytest.approx(10.0), None, None, 30.0), ("Simulation", 0.0, None, None, None),
        ("SNUG", 25.0, None, 5.0, 50.0),
    )  # fmt: skip
    alone = [line for line in all_rows() if line.metric != "distance/rms" or line.method == "snug"]
    assert reference_uncertainty(run_of(alone)) == []


def test_a_run_of_suite_speed_alone_has_its_methods_on_page_one():
    made = make_tables(run_of(all_rows()))["overview"]
    assert {"simulation", "snug", "skinning"} < {line[0] for line in made.rows}
    assert made.caption == "Means in 2 scenes."
