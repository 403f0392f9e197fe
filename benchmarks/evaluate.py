"""Metrics of finished cells, from their files: a new metric needs no new run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from snug.recipe import learns_from_simulation

from .cell import Outcome
from .methods import find_method
from .metrics.curvature import CurvatureSeries, curvature_error, curvature_series
from .metrics.energy import energy_series, mean_energy
from .metrics.geometry import Penetration, distance_rms, hem_drift, own_part_depth, penetration
from .metrics.optimality import relative_gap
from .results import Row, RunFolder

if TYPE_CHECKING:
    from reference_sim import Trajectory

    from .jobs import Trained
    from .scene import BuiltScene

MM = 1e3
DEEP = 5e-3  # [m] below the skin: what an eye sees
REFERENCE = "simulation"
UNITS = {
    "energy": "J", "curvature": "1/m", "distance": "mm", "penetration/vertices": "%",
    "penetration/deep": "%", "penetration": "mm", "drift": "mm", "dynamics": "mm",
    "cost/frame": "ms", "cost/data": "s", "cost/train": "s", "cost/memory": "MB", "exact": "m", "gap": "1",
}  # fmt: skip


def unit_of(metric: str) -> str:
    """The unit of a metric by its whole name, else by its family."""
    return UNITS.get(metric) or UNITS[metric.split("/")[0]]


@dataclasses.dataclass(frozen=True)
class Reference:
    """The simulation of a scene, with its curvature, which every other method is measured against."""

    positions: np.ndarray
    curvature: CurvatureSeries


def measure_scene(
    outcomes: Sequence[Outcome],
    scene: BuiltScene,
    run: RunFolder,
    costs: Sequence[Mapping[str, float]],
    *,
    gap_samples: int,
) -> list[dict[str, float]]:
    """Every metric of the recorded cells of one scene, in their order.

    The energies of each frame are added to the trajectory files.
    """
    from reference_sim import Trajectory

    paths = [run.trajectory_path(scene.name, o.cell.method, o.cell.seed) for o in outcomes]
    trajectories = [Trajectory.load(path) for path in paths]
    positions = [trajectory.positions for trajectory in trajectories]
    energies = energy_series(scene, positions)
    curvatures = [curvature_series(x, scene.cloth.faces) for x in positions]
    inside = penetration(positions, scene.obstacle) if scene.obstacle is not None else []
    reference = find_reference(outcomes, positions, curvatures)
    found: list[dict[str, float]] = []
    for k, (outcome, trajectory) in enumerate(zip(outcomes, trajectories)):
        _add_fields(trajectory, paths[k], energies[k], curvatures[k])
        metrics = {f"energy/{term}": mean_energy(series) for term, series in energies[k].items()}
        metrics["curvature/mean"] = float(curvatures[k].means().mean())
        if reference is not None and outcome.cell.method != REFERENCE:
            metrics |= _against(positions[k], curvatures[k], reference)
        if inside:
            metrics |= _contact(scene, positions[k], inside[k])
        if "speed" in outcome.cell.suites:
            metrics["gap/relative"] = relative_gap(scene, positions[k], samples=gap_samples)
        if scene.exact is not None:
            exact = scene.exact[: trajectory.frames]
            metrics["exact/distance"] = float(np.linalg.norm(positions[k] - exact, axis=2).max())
        held = run.trajectory_path(scene.name, f"{outcome.cell.method}-held", outcome.cell.seed)
        if held.is_file():
            difference = distance_rms(positions[k], Trajectory.load(held).positions)
            metrics["dynamics/held_difference"] = MM * float(np.sqrt((difference**2).mean()))
        metrics["cost/frame"] = MM * seconds_per_frame(trajectory)
        found.append(metrics | dict(costs[k]))
    return found


def find_reference(
    outcomes: Sequence[Outcome], positions: Sequence[np.ndarray], curvatures: Sequence[CurvatureSeries]
) -> Reference | None:
    """The simulation among the cells of a scene, where it came to its end."""
    for outcome, x, curvature in zip(outcomes, positions, curvatures):
        if outcome.cell.method == REFERENCE and outcome.status in ("ok", "stalled"):
            return Reference(x, curvature)
    return None


def seconds_per_frame(trajectory: Trajectory) -> float:
    """Mean time of a frame [s]; the first frame is given to a simulator, so it does not count."""
    seconds = trajectory.frame_seconds[1:] if trajectory.frames > 1 else trajectory.frame_seconds
    return float(seconds.mean())


def model_costs(trained: Trained | None, data_seconds: float) -> dict[str, float]:
    """cost/data, cost/train and cost/memory of a method that uses this network; nothing without one."""
    if trained is None:
        return {}
    data = data_seconds if learns_from_simulation(trained.kind) else 0.0
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
            terms=terms, dtype=find_method(cell.method).dtype,
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


def _contact(scene: BuiltScene, x: np.ndarray, inside: Penetration) -> dict[str, float]:
    """How well the cloth keeps out of the obstacle and stays where it belongs."""
    assert scene.obstacle is not None
    own = own_part_depth(x, scene.obstacle, scene.cloth.rest_positions)
    found = {
        "penetration/vertices": 100.0 * float(inside.share.mean()),
        "penetration/deep": 100.0 * float((inside.depth > DEEP).mean()),
        "penetration/depth_p99": MM * float(np.percentile(inside.depth, 99)),
        "penetration/own_part_p999": MM * float(np.percentile(own, 99.9)),
    }
    if scene.dressed is not None and scene.origin_heights is not None:
        found["drift/hem"] = MM * hem_drift(x, scene.dressed.garment.hem, scene.origin_heights)
    return found


def _against(x: np.ndarray, curvature: CurvatureSeries, reference: Reference) -> dict[str, float]:
    frames = min(len(x), len(reference.positions))
    theirs = CurvatureSeries(reference.curvature.curvature[:frames], reference.curvature.area[:frames])
    ours = CurvatureSeries(curvature.curvature[:frames], curvature.area[:frames])
    distance = distance_rms(x[:frames], reference.positions[:frames])
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
