"""Metrics of finished cells, from their files: a new metric needs no new run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .cell import Outcome
from .metrics.curvature import CurvatureSeries, curvature_error, curvature_series
from .metrics.energy import energy_series, mean_energy
from .metrics.geometry import distance_rms, penetration
from .results import Row, RunFolder

if TYPE_CHECKING:
    from reference_sim import Trajectory

    from .jobs import Trained
    from .scene import BuiltScene

MM = 1e3
REFERENCE = "simulation"
UNITS = {
    "energy": "J", "curvature": "1/m", "distance": "mm", "penetration/vertices": "%",
    "penetration/depth_p99": "mm", "dynamics": "mm", "cost/frame": "ms", "cost/data": "s",
    "cost/train": "s", "cost/memory": "MB", "exact": "m",
}  # fmt: skip


def unit_of(metric: str) -> str:
    """The unit of a metric by its whole name, else by its family."""
    return UNITS.get(metric) or UNITS[metric.split("/")[0]]


@dataclasses.dataclass(frozen=True)
class Reference:
    """The simulation of a scene, with its curvature, which every other method is measured against."""

    positions: np.ndarray
    curvature: CurvatureSeries


def load_reference(run: RunFolder, outcomes: list[Outcome], scene: BuiltScene) -> Reference | None:
    """The reference of a scene, where it was run and came to its end."""
    from reference_sim import Trajectory

    for outcome in outcomes:
        if outcome.cell.method == REFERENCE and outcome.recorded and outcome.status in ("ok", "stalled"):
            path = run.trajectory_path(scene.name, REFERENCE, outcome.cell.seed)
            positions = Trajectory.load(path).positions
            return Reference(positions, curvature_series(positions, scene.cloth.faces))
    return None


def measure(
    outcome: Outcome,
    scene: BuiltScene,
    run: RunFolder,
    reference: Reference | None,
    costs: Mapping[str, float],
) -> dict[str, float]:
    """Every metric of a recorded cell. The energies of each frame are added to its trajectory file."""
    from reference_sim import Trajectory

    cell = outcome.cell
    path = run.trajectory_path(scene.name, cell.method, cell.seed)
    trajectory = Trajectory.load(path)
    energies = energy_series(scene, trajectory.positions)
    curvature = curvature_series(trajectory.positions, scene.cloth.faces)
    _add_fields(trajectory, path, energies, curvature)

    found = {f"energy/{term}": mean_energy(series) for term, series in energies.items()}
    found["curvature/mean"] = float(curvature.means().mean())
    if reference is not None and cell.method != REFERENCE:
        found |= _against(trajectory, curvature, reference)
    if scene.obstacle is not None:
        inside = penetration(trajectory.positions, scene.obstacle)
        found["penetration/vertices"] = 100.0 * float(inside.share.mean())
        found["penetration/depth_p99"] = MM * float(np.percentile(inside.depth, 99))
    if scene.exact is not None:
        exact = scene.exact[: trajectory.frames]
        found["exact/distance"] = float(np.linalg.norm(trajectory.positions - exact, axis=2).max())
    held = run.trajectory_path(scene.name, f"{cell.method}-held", cell.seed)
    if held.is_file():
        difference = distance_rms(trajectory.positions, Trajectory.load(held).positions)
        found["dynamics/held_difference"] = MM * float(np.sqrt((difference**2).mean()))
    found["cost/frame"] = MM * seconds_per_frame(trajectory)
    return found | dict(costs)


def seconds_per_frame(trajectory: Trajectory) -> float:
    """Mean time of a frame [s]; the first frame is given to a simulator, so it does not count."""
    seconds = trajectory.frame_seconds[1:] if trajectory.frames > 1 else trajectory.frame_seconds
    return float(seconds.mean())


def model_costs(trained: Trained, data_seconds: float) -> dict[str, float]:
    """cost/data, cost/train and cost/memory of a method that uses this network."""
    data = data_seconds if trained.kind == "supervised" else 0.0
    return {"cost/data": data, "cost/train": trained.seconds, "cost/memory": trained.megabytes}


def rows_of(outcome: Outcome, metrics: Mapping[str, float], scene: BuiltScene | None) -> list[Row]:
    """The rows of a cell in each of its suites; a cell without metrics is one row with its reason."""
    cell = outcome.cell
    terms = "+".join(scene.terms) if scene else ""
    rows = []
    for suite in cell.suites:
        base = Row(
            suite, cell.scene.name, cell.method, cell.seed, "cost/frame", "ms", None,
            outcome.status if outcome.status in ("failed", "skipped") else "failed", outcome.reason,
            terms=terms,
        )  # fmt: skip
        if not metrics:
            rows.append(base)
        for metric, value in metrics.items():
            finite = bool(np.isfinite(value))
            status = outcome.status if finite else ("failed" if outcome.status == "ok" else outcome.status)
            reason = outcome.reason if finite else outcome.reason or f"{metric} is not finite"
            rows.append(
                dataclasses.replace(
                    base, metric=metric, unit=unit_of(metric), value=float(value) if finite else None,
                    status=status, reason=reason,
                )
            )  # fmt: skip
    return rows


def _against(trajectory: Trajectory, curvature: CurvatureSeries, reference: Reference) -> dict[str, float]:
    frames = min(trajectory.frames, len(reference.positions))
    theirs = CurvatureSeries(reference.curvature.curvature[:frames], reference.curvature.area[:frames])
    ours = CurvatureSeries(curvature.curvature[:frames], curvature.area[:frames])
    distance = distance_rms(trajectory.positions[:frames], reference.positions[:frames])
    return {
        "curvature/error": float(curvature_error(ours, theirs).mean()),
        "curvature/mean_difference": float((ours.means() - theirs.means()).mean()),
        "distance/rms": MM * float(np.sqrt((distance**2).mean())),
    }


def _add_fields(
    trajectory: Trajectory, path: Path, energies: Mapping[str, np.ndarray], curvature: CurvatureSeries
) -> None:
    """Write the trajectory again with one number per frame for each energy and for the curvature."""
    fields = {name: v for name, v in trajectory.frame_fields.items() if not name.startswith("energy/")}
    fields |= {f"energy/{term}": series for term, series in energies.items()}
    fields["curvature/mean"] = curvature.means()
    dataclasses.replace(trajectory, frame_fields=fields).save(path)
