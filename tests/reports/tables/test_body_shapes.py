"""Table of body shapes."""

from __future__ import annotations

import numpy as np
import pytest

from reports.tables.pivots import shapes
from tests.reports.report_folder import row, run_of


def shaped(method, metric, values, **more):
    rows = [row(f"shapes/{place}", method, metric, value, suite="shapes", garment="tshirt", **more)
            for place, value in enumerate(values)]  # fmt: skip
    return rows


def test_energies_are_listed_by_body_shape():
    rows = shaped("simulation", "body/shape", (0.0, 6.0, 4.0), unit="1")
    rows += shaped("simulation", "energy/total", (0.3, 0.5, 0.4))
    twin = {"family": "simulation-perturbed", "level": 1e-4}
    rows += shaped("simulation-perturbed-1e-4", "energy/total", (0.3, 0.5, 0.4), **twin)
    rows += shaped("skinning", "energy/total", (0.8, 1.0, 1.4))  # 0.5, 0.5 and 1 J above the simulation
    rows += shaped("snug", "energy/total", (0.35, 0.8, 0.6))  # 10, 60 and 20 %
    rows += shaped("snug", "energy/strain", (0.1, 0.4, 0.2))

    (together,) = shapes(run_of(rows))
    names = [column.name for column in together.columns]
    assert names == ["scene", "method", "typical", "mean", "energy/total", "energy/strain"]
    lines = {(line[0], line[1]): (None, *line[1:]) for line in together.rows}
    methods = ("simulation", "skinning", "snug")
    assert list(lines) == [(s, m) for s in ("other shapes", "mean shape") for m in methods]
    typical = np.sinh(np.arcsinh([60.0, 20.0]).mean())
    together = lines["other shapes", "snug"]
    assert together[2].shown == pytest.approx(typical) and together[3] == pytest.approx(40.0)
    assert together[4].value == pytest.approx(0.7)
    assert lines["mean shape", "snug"][3] == pytest.approx(10.0)
    assert lines["mean shape", "simulation"][2:4] == lines["mean shape", "skinning"][2:4] == (None, None)

    one = [r for r in rows if r.scene == "shapes/0"]
    assert shapes(run_of(one)) == []
