"""Metrics of finished cells, from their files: a new metric needs no new run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .cell import Outcome
from .hem_dynamics import hem_motion
from .methods.solvers import MOVED
from .metrics.curvature import CurvatureSeries, curvature_series
from .metrics.energy import energy_series, mean_energy
from .metrics.geometry import penetration, whole_frames
from .metrics.optimality import optimality
from .metrics.time_error import time_errors
from .named_metrics import Reference, against, contact, rms, shape
from .results import RunFolder

if TYPE_CHECKING:
    from .scene import BuiltScene

REFERENCE = "simulation"
WHOLE = ("ok", "stalled")  # statuses of cells that came to their last frame


def measure_scene(
    outcomes: Sequence[Outcome],
    scene: BuiltScene,
    run: RunFolder,
    *,
    gap_samples: int,
) -> list[dict[str, float]]:
    """Every metric of the recorded cells of one scene, in their order.

    What is not finite from some frame on is measured up to there: it ends no other cell's metrics. The
    energies of each frame are added to the trajectory files.
    """
    from reference_sim import Trajectory
    from reference_sim.trajectory import replace_frame_fields

    paths = [run.trajectory_path(scene.name, o.cell.method, o.cell.seed) for o in outcomes]
    trajectories = [Trajectory.load(path) for path in paths]
    positions = [whole_frames(trajectory.positions) for trajectory in trajectories]
    energies = energy_series(scene, positions)
    curvatures = [curvature_series(x, scene.cloth.faces) for x in positions]
    inside = penetration(positions, scene.obstacle) if scene.obstacle is not None else []
    reference = find_reference(outcomes, positions, curvatures)
    hem = hem_motion(scene, reference.positions, run) if reference is not None else None
    skinned = skinned_frames(scene) if any("speed" in o.cell.suites for o in outcomes) else None
    found: list[dict[str, float]] = []
    for k, (outcome, trajectory) in enumerate(zip(outcomes, trajectories)):
        if not len(positions[k]):
            found.append({})
            continue
        fields = {f"energy/{term}": series for term, series in energies[k].items()}
        fields["curvature/mean"] = curvatures[k].means()
        if hem is not None:
            fields |= hem.curves(positions[k])
        lost = trajectory.frames - len(positions[k])
        fields = {name: np.pad(field, (0, lost), constant_values=np.nan) for name, field in fields.items()}
        replace_frame_fields(paths[k], fields, family="energy/")
        metrics = {f"energy/{term}": mean_energy(series) for term, series in energies[k].items()}
        metrics["curvature/mean"] = float(curvatures[k].means().mean())
        metrics |= shape(scene, positions[k])
        if reference is not None and outcome.cell.method != REFERENCE:
            metrics |= against(positions[k], curvatures[k], reference)
        if inside:
            metrics |= contact(scene, positions[k], inside[k])
        if "speed" in outcome.cell.suites:
            metrics |= optimality(scene, positions[k], samples=gap_samples, skinned=skinned).metrics()
        if scene.exact is not None:
            exact = scene.exact[: len(positions[k])]
            metrics["exact/distance"] = float(np.linalg.norm(positions[k] - exact, axis=2).max())
        held = run.held_path(scene.name, outcome.cell.method, outcome.cell.seed)
        still = Trajectory.load(held).positions if held.is_file() else None
        if still is not None:
            metrics["dynamics/held_difference"] = rms(positions[k], still[: len(positions[k])])
        if hem is not None and (still is None or np.isfinite(still).all()):
            metrics |= hem.measure(positions[k], still)
        found.append(metrics)
    whole = {o.cell.method: k for k, o in enumerate(outcomes) if o.status in WHOLE}
    if REFERENCE in whole:
        found[whole[REFERENCE]] |= time_errors({method: found[k] for method, k in whole.items()})
    return found


def skinned_frames(scene: BuiltScene) -> np.ndarray | None:
    """What the energy gap is a share of: the skinned garment (T,V,3) [m]; None where there is no body."""
    if scene.dressed is None:
        return None
    from snug.dressed_body import DressedBody
    from snug.recipe import DEFAULT

    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    return dressed.skinned(scene.dressed.motion, smoothing=DEFAULT.smoothing)


def find_reference(
    outcomes: Sequence[Outcome], positions: Sequence[np.ndarray], curvatures: Sequence[CurvatureSeries]
) -> Reference | None:
    """The simulation among the cells of a scene, where it came to its end."""
    whole = {o.cell.method: k for k, o in enumerate(outcomes) if o.status in WHOLE}
    if REFERENCE not in whole:
        return None
    at, moved = whole[REFERENCE], whole.get(MOVED)
    floor = None if moved is None else rms(positions[moved], positions[at])
    return Reference(positions[at], curvatures[at], floor)
