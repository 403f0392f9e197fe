"""A small run folder for tests of the report: rows of every suite, trajectories and models."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import h5py
import numpy as np

from benchmarks.results import Row

TERMS = {"strain": 0.1, "bending": 0.01, "gravity": 0.3, "inertia": 0.004, "collision": 0.02}
METHODS = {"simulation": 1.0, "skinning": 9.0, "snug": 2.0, "pbns": 3.0}
SCENES = ("dressed/walk", "dressed/jump")
FRAMES = 5


def row(scene="dressed/walk", method="snug", metric="energy/strain", value=1.0, *, seed=0, **more) -> Row:
    more = {"suite": "garments", "unit": "J", **more}
    return Row(scene=scene, method=method, seed=seed, metric=metric, value=value, **more)


def skipped(reason="no body here", **more) -> Row:
    return row(value=None, status="skipped", reason=reason, **more)


def write_mesh(path: Path, positions: np.ndarray, faces: np.ndarray, fields: dict[str, np.ndarray]) -> None:
    """A trajectory file with what the report reads of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        file["VTKHDF/Points"] = positions.reshape(-1, 3)
        file["VTKHDF/NumberOfPoints"] = [positions.shape[1]]
        file["VTKHDF/Polygons/Connectivity"] = faces.ravel()
        file["VTKHDF/Steps/Values"] = np.arange(len(positions)) / 30.0
        own = file.create_group("benchmark")
        own.attrs["frames"] = len(positions)
        own.create_group("frame_fields")
        for name, values in fields.items():
            own["frame_fields"][name.replace("/", ":")] = values


def sheet(height: float) -> tuple[np.ndarray, np.ndarray]:
    """A 4 x 4 sheet in the xy plane at z = height, (T,V,3) and (F,3)."""
    x, y = np.meshgrid(np.linspace(0, 0.4, 4), np.linspace(1.0, 1.5, 4))
    points = np.stack([x.ravel(), y.ravel(), np.full(16, height)], axis=1)
    corner = (np.arange(3)[:, None] * 4 + np.arange(3)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 5], 1), np.stack([corner, corner + 5, corner + 4], 1)]
    )
    return np.repeat(points[None], FRAMES, axis=0), faces


def write_model(path: Path, kind: str, **last: float) -> None:
    """The header of a safetensors file, with a short history."""
    history = [{"step": s, "seconds": 0.1 * s, "loss": 2.0 / s, **last} for s in (1, 2, 4)]
    header = json.dumps({"__metadata__": {"snug": json.dumps({"kind": kind, "history": history})}}).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(struct.pack("<Q", len(header)) + header)


def all_rows() -> list[Row]:
    """Two dressed scenes, a cut solver, a scene without a body, checks and extreme cases."""
    rows = []
    for number, scene in enumerate(SCENES):
        for method, factor in METHODS.items():
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
        more = {"suite": "speed", "method": f"newton-{cut}"}
        rows.append(row(SCENES[0], metric="cost/frame", unit="ms", value=2.0 * cut, **more))
        rows.append(row(SCENES[0], metric="curvature/error", unit="1/m", value=3.0 / cut, **more))
        rows.append(row(SCENES[0], metric="energy/total", value=1.5 - cut * 0.2, **more))
        rows.append(row("hanging_sheet", metric="energy/strain", value=0.0, **more))
    rows.append(row("free_fall", "simulation", "energy/gravity", -0.5, suite="speed"))
    rows.append(skipped(scene="hanging_sheet", suite="speed"))
    check = {"suite": "validation", "method": "simulation", "metric": "check", "unit": "m"}
    rows.append(row("free_fall", value=1e-15, expected=0.0, tolerance=1e-12, **check))
    rows.append(row("zero_modes", value=6.0, expected=6.0, tolerance=0.0, **check))
    more = {"status": "failed", "reason": "off", "expected": 0.28350664, "tolerance": 1e-4}
    rows.append(row("sag", value=0.3, **check, **more))
    case = {"suite": "extremes", "method": "simulation", "metric": "outcome", "unit": "vertex weights"}
    rows.append(row("stiff", value=3e-7, **case))
    rows.append(row("teleport", value=None, status="timeout", reason="over 30 s", **case))
    return rows
