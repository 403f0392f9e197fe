"""A small run folder for tests of the report: rows of every suite, trajectories and models."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.method import MethodEntry
from benchmarks.methods import METHODS
from benchmarks.metrics import find_metric
from benchmarks.results.row import Row
from benchmarks.results.run_folder import FORMAT, RunFolder
from reference_sim import Trajectory
from reports.finished_run import Run, make_run
from tests.reference_sim.meshes import grid

TERMS = {"strain": 0.1, "bending": 0.01, "gravity": 0.3, "inertia": 0.004, "collision": 0.02}
SHOWN = {"simulation": 1.0, "skinning": 9.0, "snug": 2.0, "pbns": 3.0}
SCENES = ("tshirt/walk", "tshirt/jump")
FRAMES = 5
OF_CASES = ("check", "outcome")

DECLARED = {entry.name: entry for entry in METHODS}  # any other is a network of its own


def row(scene="tshirt/walk", method="snug", metric="energy/strain", value=1.0, *, seed=0, **kw) -> Row:
    """A row with the columns that its scene and method declare."""
    network = MethodEntry(name=method, description="", role="network", seeded=True,
                      pairing_group=method)  # fmt: skip
    entry = DECLARED.get(method, network)
    garment, _, motion = scene.partition("/")
    declared = {
        "role": entry.role, "family": entry.family or method, "base": entry.base,
        "level": entry.level, "seeded": entry.seeded and not metric.startswith("cost/"),
        "pairing_group": entry.pairing_group,
        "garment": garment if motion else "", "motion": motion, "part": "whole" if motion else "",
    }  # fmt: skip
    fields = {"suite": "garments", "unit": "J", "hardware": "here", **declared, **kw}
    return Row(scene=scene, method=method, seed=seed, metric=metric, value=value, **fields)


def skipped(reason="no body here", **more) -> Row:
    return row(value=None, status="skipped", reason=reason, **more)


def declaration(rows: Sequence[Row], **more) -> dict[str, Any]:
    """Return the content of run.json for these rows."""
    names = dict.fromkeys(r.metric for r in sorted(rows, key=lambda r: r.metric == "energy/total"))
    return {
        "format": FORMAT,
        "metrics": {name: vars(find_metric(name)) for name in names if name not in OF_CASES},
        "methods": {name: {"label": entry.label} for name, entry in DECLARED.items()},
        "scenes": {r.scene: {} for r in sorted(rows, key=lambda r: r.garment != "tshirt") if r.garment},
        "cases": {r.scene: {"scene": r.scene, "metric": r.metric} for r in rows if r.metric in OF_CASES},
        **more,
    }  # fmt: skip


def run_of(rows: Sequence[Row], **more) -> Run:
    return make_run(declaration(rows, **more), rows)


def run_folder(path: Path, rows: Sequence[Row], **more) -> RunFolder:
    """A folder with run.json and results.csv of these rows."""
    folder = RunFolder(path)
    folder.write_rows(rows)
    folder.write_config(declaration(rows, **more))
    return folder


def write_mesh(
    path: Path, positions: np.ndarray, faces: np.ndarray, fields: dict[str, np.ndarray]
) -> None:
    """A trajectory file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    times = np.arange(len(positions)) / 30.0
    Trajectory(positions, faces, times, np.zeros(len(positions)), frame_fields=fields).save(path)


def write_roll_outs(run: RunFolder, scenes: Iterable[str], methods: Iterable[str]) -> None:
    """Sheets in the place of a body and of cloth, whose energies rise."""
    fields = {f"energy/{term}": np.linspace(0, value, FRAMES) for term, value in TERMS.items()}
    for scene in scenes:
        write_mesh(run.trajectory_path(scene, "body"), *sheet(0.0), {})
        for method in methods:
            write_mesh(run.trajectory_path(scene, method), *sheet(0.1), fields)


def sheet(height: float) -> tuple[np.ndarray, np.ndarray]:
    """A 4 x 4 sheet in the xy plane at z = height, (T,V,3) and (F,3)."""
    x, faces = grid(3, 3, width=0.5, depth=0.4)
    points = x[:, [2, 0, 1]] + [0.0, 1.0, height]
    return np.repeat(points[None], FRAMES, axis=0), faces


def all_rows() -> list[Row]:
    """Two scenes on a body, a truncated solver, a scene without a body, checks and stress tests."""
    rows = []
    for number, scene in enumerate(SCENES):
        for method, factor in SHOWN.items():
            for term, value in TERMS.items():
                rows.append(row(scene, method, f"energy/{term}", factor * value * (1 + number)))
            rows.append(row(scene, method, "energy/total", factor * (1 + number)))
            rows.append(row(scene, method, "cost/frame", 10.0 / factor, unit="ms"))
            if method != "simulation":
                rows.append(row(scene, method, "curvature/error", factor, unit="1/m"))
        for metric in ("energy/strain", "cost/frame"):
            failed = {"value": None, "status": "failed", "reason": "diverged at step 7"}
            rows.append(row(scene, "supervised", metric, **failed))
    for cut in (1, 4):
        fields = {"suite": "speed", "method": f"newton-{cut}"}
        rows.append(row(SCENES[0], metric="cost/frame", unit="ms", value=2.0 * cut, **fields))
        rows.append(row(SCENES[0], metric="curvature/error", unit="1/m", value=3.0 / cut, **fields))
        rows.append(row(SCENES[0], metric="energy/total", value=1.5 - cut * 0.2, **fields))
        rows.append(row("hanging_sheet", metric="energy/strain", value=0.0, **fields))
    rows.append(row("free_fall", "simulation", "energy/gravity", -0.5, suite="speed"))
    rows.append(skipped(scene="hanging_sheet", suite="speed"))
    check = {"suite": "validation", "method": "simulation", "metric": "check", "unit": "m"}
    rows.append(row("falls_freely", value=1e-15, expected=0.0, tolerance=1e-12, **check))
    rows.append(row("zero_modes", value=6.0, expected=6.0, tolerance=0.0, **check))
    fields = {"status": "failed", "reason": "off", "expected": 0.28350664, "tolerance": 1e-4}
    rows.append(row("sag", value=0.3, **check, **fields))
    case = {"suite": "extremes", "method": "simulation", "metric": "outcome", "unit": "vertex weights"}
    rows.append(row("stiff", value=3e-7, **case))
    rows.append(row("teleport", value=None, status="timeout", reason="over 30 s", **case))
    return rows
