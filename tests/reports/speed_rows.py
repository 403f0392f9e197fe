"""Rows of a run of suite speed: run times, gaps and curvature of solvers and networks in two worn scenes."""

from __future__ import annotations

from benchmarks.results.row import Row
from tests.reports.report_folder import row as any_row

WORN = {
    "simulation": (100.0, 0.0, None),
    "newton-1": (12.0, 0.2, 3.0),
    "newton-4": (45.0, 0.01, 1.0),
    "lbfgs-5": (4.0, 0.3, 4.0),
    "lbfgs-20": (16.0, 0.05, 2.0),
    "skinning": (0.1, 1.0, 4.5),
    "snug": (0.25, 0.1, 5.0),
    "snug+lbfgs-1": (1.0, 0.08, 2.5),
    "snug+lbfgs-4": (50.0, 0.02, 1.5),
}


SCENES = ("tshirt/walk", "tshirt/jump")


def row(scene, method, metric, value, unit="1", **more) -> Row:
    return any_row(scene, method, metric, value, **{"suite": "speed", "unit": unit, **more})


def all_rows() -> list[Row]:
    rows = []
    for scene in SCENES:
        for method, (time, gap, curvature) in WORN.items():
            rows += [row(scene, method, "cost/frame", time, "ms"), row(scene, method, "gap/energy", gap)]
            if curvature is not None:
                rows.append(row(scene, method, "curvature/error", curvature, "1/m"))
                rows.append(row(scene, method, "distance/rms", 10.0 * curvature, "mm"))
        rows.append(row(scene, "snug", "cost/train", 200.0, "s"))
        rows.append(row(scene, "snug", "cost/data", 0.0, "s"))
        for member in ("simulation-perturbed-1e-4", "simulation-1e-8"):
            rows.append(row(scene, member, "distance/rms", 21.0, "mm"))
        rows.append(row(scene, "simulation", "gap/refrozen", 0.015, "J"))
    for method in ("simulation", "newton-1", "newton-4"):
        time, gap, _ = WORN[method]
        rows += [row("sheet", method, "cost/frame", time, "ms"), row("sheet", method, "gap/energy", gap)]
    return rows
