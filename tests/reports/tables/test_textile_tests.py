"""Textile tests in the report: order of the fabrics, drape on meshes, published bands, figure."""

from __future__ import annotations

import pytest

from reports.figures.fabric.textile_errors import points_of_tests, textile_errors
from reports.tables.fabric.textile_tests import fabric_bands, fabric_drape, fabric_order
from tests.reports.report_folder import row, run_of

READ = {"cantilever": ("fabric/bending_length", "mm"), "drape": ("fabric/drape_coefficient", "%")}
SOLVER = {"role": "solver", "family": "vbd", "level": 5.0}


def read(test, method, values, error, ms, **more):
    metric, unit = READ[test]
    for fabric, value in values.items():
        scene = f"fabric/{test}/{fabric}"
        yield row(scene, method, metric, value, suite="fabric", unit=unit, **more)
        yield row(scene, method, "fabric/error", error, suite="fabric", unit="%", **more)
        yield row(scene, method, "cost/frame", ms, suite="fabric", unit="ms", **more)


@pytest.fixture
def rows():
    true = {"limp": 40.0, "like": 42.0, "stiff": 80.0, "measured/x": 60.0}
    wrong = {"limp": 50.0, "like": 45.0, "stiff": 55.0, "measured/x": 58.0}
    return [
        *read("drape", "simulation", true, 0.01, 50.0, role="reference"),
        *read("drape", "vbd-5", wrong, 9.0, 5.0, **SOLVER),
        *read("cantilever", "simulation", true, 0.01, 4.0, role="reference"),
        *read("cantilever", "vbd-5", true, 3.0, 0.5, **SOLVER),
    ]


def test_pairs_in_the_wrong_order_are_counted(rows):
    (table,) = fabric_order(run_of(rows))
    lines = {line[0]: line[1:] for line in table.rows}
    # limp and like are 2 points apart, nearer than what is asked for.
    assert lines["simulation"][3:] == ("0 of 6", "0 of 5", "")
    assert lines["vbd-5"][3:] == ("0 of 6", "1 of 5", "measured/x above stiff (drape)")
    assert [cell.value for cell in lines["vbd-5"][:3]] == [5.0, 3.0, 9.0]


def test_errors_are_drawn_against_run_time(rows):
    points = points_of_tests(run_of(rows))
    assert {test: [(p.method, p.time, p.error) for p in series] for test, series in points.items()} == {
        "cantilever": [("simulation", 4.0, pytest.approx(0.01)), ("vbd-5", 0.5, 3.0)],
        "drape": [("simulation", 50.0, pytest.approx(0.01)), ("vbd-5", 5.0, 9.0)],
    }
    (drawing,) = textile_errors(run_of(rows))
    assert "Grey" not in drawing.caption  # no perturbed run: no band
    perturbed = {"role": "reference-variant", "family": "simulation-perturbed", "level": 1e-4}
    exact = perturbed | {"family": "simulation-tolerance", "level": 1e-8}
    for name, member in (("simulation-perturbed-1e-4", perturbed), ("simulation-1e-8", exact)):
        rows += read("drape", name, {"limp": 40.0}, 4.0, 50.0, **member)
    (drawing,) = textile_errors(run_of(rows))
    assert "Grey" in drawing.caption


def test_cases_make_the_tables_of_the_reference():
    described = {
        "drape_limp_5_rings_30_steps": ("drape coefficient, 60 g/m2, bending length 14.0 mm; 5 rings", 43.5),
        "drape_limp_7_rings_30_steps": ("drape coefficient, 60 g/m2, bending length 14.0 mm; 7 rings", 42.5),
        "drape_limp_7_rings_60_steps": ("drape coefficient, 60 g/m2, bending length 14.0 mm; 7 rings", 39.3),
        "drape_band_silk_least": ("the least drape coefficient published of silk, 20 %", 9.3),
        "drape_band_silk_largest": ("the largest drape coefficient published of silk, 40 %", 14.3),
    }
    rows = [row(name, "simulation", "check", value, suite="fabric") for name, (_, value) in described.items()]
    cases = {name: {"description": text, "scene": name} for name, (text, _) in described.items()}
    run = run_of(rows, cases=cases)
    (drape,), (bands,) = fabric_drape(run), fabric_bands(run)
    assert drape.rows == (("limp", 14.0, 43.5, 42.5, 39.3),)
    assert bands.rows == (("silk", 20.0, 40.0, 9.3, 14.3),)
