"""A small folder of the form of GAUGE's: its own numbers, four markers a side, two fabrics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

SIDE, SPACING, FPS = 4, 0.1, 30
HEIGHTS = (0.0, 0.01, 0.03)  # [m] of an inner marker above the sheet, one a trial
TILTS = (0.0, 0.2, 0.4)  # [rad] of the last piece of a line, one a trial
FABRICS = {"satin": (0.07, 1.5e-6), "oxford": (0.2, 4.8e-5)}


def grid() -> np.ndarray:
    """Markers (16, 3) [m] of a vertical sheet."""
    y, z = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    return np.stack([0 * y, y, z], axis=-1).reshape(-1, 3) * SPACING + [0.5, 0.3, 0.2]


def strip() -> np.ndarray:
    """Markers (8, 3) [m] along both edges of a horizontal sheet."""
    x, y = np.meshgrid(np.arange(SIDE), np.arange(2), indexing="ij")
    return np.stack([x, 4 * y, 0 * x], axis=-1).reshape(-1, 3) * SPACING + [0.2, 0.2, 0.3]


def _metadata(markers: np.ndarray, mesh: dict[str, Any]) -> dict[str, Any]:
    material = {name: {"mass": 0.16 * rho, "density": rho, "bend stiffness": k}
                for name, (rho, k) in FABRICS.items()}  # fmt: skip
    return {
        "description": "a sheet",
        "assets": {"rod": {"material": {"wood": {"mass": 0.02}}}, "textile": {"material": material}},
        "tasks": {"default": {"record": {"assets": ["markers"], "dim": ["x", "y", "z"], "fps": FPS}}},
        "markers": {"translation": markers.tolist(), **mesh},
    }


def _trial(x: np.ndarray) -> dict[str, Any]:
    """Trial of positions x (T, M, 3) [m]; its markers stand in another order than the metadata's."""
    millimetres = 1e3 * x[:, ::-1]
    cloud = {f"marker-{i + 1:02d}": dict(zip("xyz", millimetres[:, i].T.tolist())) for i in range(x.shape[1])}
    rod = {axis: [0.0] * len(x) for axis in "xyz"}
    return {"FPS": FPS, "translation unit": "mm", "rod": rod, "textile": cloud}


def _write(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def make_folder(folder: Path) -> Path:
    """Write stretching and bending with three trials of satin each: flat at first, then bent."""
    number = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    inner = number[1:-1, 1:-1].ravel()
    corner = number[[0, 0, -1, -1], [0, -1, 0, -1]]
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    edge = np.setdiff1d(number, [*inner, *corner])
    sets = {"corner": corner.tolist(), "edge": edge.tolist(), "inner": inner.tolist()}
    described = folder / "metadata/textile"
    _write(described / "textile stretching.json", _metadata(grid(), {"faces": faces.tolist(), **sets}))
    ends = {"corner": [0, 1, 6, 7], "edge": [2, 3, 4, 5]}
    lines = [[i, i + 2] for i in range(2 * SIDE - 2)]
    _write(described / "textile bending.json", _metadata(strip(), {"lines": lines, **ends}))
    for trial, (height, tilt) in enumerate(zip(HEIGHTS, TILTS), start=1):
        x = np.stack([grid()] * (4 + trial))  # of different lengths
        x[2:, inner[0], 0] += height
        _write(folder / f"data/textile/textile stretching/json/satin/{trial}.json", _trial(x))
        x = np.stack([strip()] * 4)
        x[2:, -2:, 0] += SPACING * (np.cos(tilt) - 1)
        x[2:, -2:, 2] -= SPACING * np.sin(tilt)
        _write(folder / f"data/textile/textile bending/json/satin/{trial}.json", _trial(x))
    return folder
