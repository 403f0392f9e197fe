"""Do two minimisers agree, and how far apart may two right answers be: the same walk, several ways."""

from __future__ import annotations

import numpy as np

from reference_sim import Trajectory

from ..metrics.curvature import curvature_series
from .child import Row
from .tshirt import dressed, walk

CASES = ("walk, 1000",)
TERMS = ("strain", "bending", "gravity", "inertia", "collision")


def measure(case: str, repeats: int) -> list[Row]:
    """Energies, mean curvature and time of Newton, L-BFGS, and Newton from starts moved by 0.1 mm."""
    scene = dressed(case)
    noise = np.random.default_rng(0).normal(0, 1e-4 / np.sqrt(3), (3, *scene.start.shape))
    walk(scene, frames=2)
    walk(scene, frames=2, method="lbfgs")
    newton, lbfgs = walk(scene), walk(scene, method="lbfgs")
    moved = [walk(scene, start=scene.start + shift) for shift in noise]
    rows: list[Row] = []
    for name in (*(f"energy/{term}" for term in TERMS), "mean curvature"):
        unit = "1/m" if name == "mean curvature" else "J"
        ours, theirs = _number(newton, name), _number(lbfgs, name)
        spread = [_number(run, name) for run in moved]
        rows.append((f"{name}: Newton", ours, unit))
        rows.append((f"{name}: L-BFGS minus Newton", theirs - ours, unit))
        rows.append(
            (f"{name}: moved starts, extremes", f"{min(spread) - ours:+.2e} {max(spread) - ours:+.2e}", unit)
        )
    for label, run in (("Newton", newton), ("L-BFGS then Newton", lbfgs)):
        rows.append((f"{label}: frame, median", 1e3 * float(np.median(run.frame_seconds[1:])), "ms"))
        rows.append(
            (f"{label}: converged frames", f"{int(run.frame_fields['converged'].sum())} of {run.frames}", "")
        )
    distances = [np.linalg.norm(run.positions - newton.positions, axis=2).mean() for run in (lbfgs, *moved)]
    rows.append(("mean distance, L-BFGS to Newton", 1e3 * float(distances[0]), "mm"))
    rows.append(("mean distance, moved start to Newton", 1e3 * float(np.mean(distances[1:])), "mm"))
    return rows


def _number(run: Trajectory, name: str) -> float:
    if name == "mean curvature":
        return float(curvature_series(run.positions, run.faces).means().mean())
    return float(np.nanmean(run.frame_fields[name]))
