"""Runs one cell: the only place that holds a clock. The raw trajectory is written before it is measured."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .methods import find_method
from .plan import Cell
from .results import RunFolder

if TYPE_CHECKING:
    from reference_sim import Trajectory

    from .scene import BuiltScene

# What a trajectory says of itself, in the words of a result row. A solver cut short on purpose is ok.
WORDS = {"converged": "ok", "ok": "ok", "stalled": "stalled", "diverged": "diverged", "timeout": "timeout"}


@dataclass(frozen=True)
class Outcome:
    """How a cell ended. seconds: wall time of run() alone. A failed cell has left no trajectory."""

    cell: Cell
    status: str
    reason: str = ""
    seconds: float = 0.0
    recorded: bool = False


def run_cell(cell: Cell, scene: BuiltScene, run: RunFolder, *, device: str) -> Outcome:
    """Prepare off the clock, run on it, write the trajectory. Whatever is raised becomes a failed outcome."""
    entry = find_method(cell.method)
    if reason := entry.skip(cell.scene):
        return Outcome(cell, "skipped", reason)
    path = run.trajectory_path(cell.scene.name, cell.method, cell.seed)
    try:
        method = entry.make(models=run.models, seed=cell.seed, device=device)
        method.prepare(scene)
        clock = time.perf_counter()
        trajectory = method.run()
        seconds = time.perf_counter() - clock
        status, reason = judge(trajectory, scene, cut_short=entry.cut_short)
        provenance = trajectory.provenance | {"run_seconds": seconds, "scene": scene.name, "seed": cell.seed}
        path.parent.mkdir(parents=True, exist_ok=True)
        dataclasses.replace(trajectory, provenance=provenance).save(path)
        held = getattr(method, "held", None)
        if held is not None:
            held().save(run.trajectory_path(cell.scene.name, f"{cell.method}-held", cell.seed))
    except Exception as error:
        return Outcome(cell, "failed", " ".join(f"{type(error).__name__}: {error}".split()))
    return Outcome(cell, status, reason, seconds, recorded=True)


def judge(trajectory: Trajectory, scene: BuiltScene, *, cut_short: bool) -> tuple[str, str]:
    """Status and reason of a row, from the trajectory's own status and from what is in it."""
    import numpy as np

    reason = " ".join(trajectory.reason.split())
    if not np.isfinite(trajectory.positions).all():
        return "diverged", reason or "a position is not finite"
    if trajectory.frames < scene.frames:
        return "diverged", reason or f"ended after {trajectory.frames} of {scene.frames} frames"
    if trajectory.status == "max_iterations":
        return ("ok", "") if cut_short else ("stalled", reason)
    if trajectory.status not in WORDS:
        return "failed", f"unknown status {trajectory.status}: {reason}"
    status = WORDS[trajectory.status]
    if status != "ok" and "converged" in trajectory.frame_fields:
        bad = int((trajectory.frame_fields["converged"] < 0.5).sum())
        reason = f"{bad} of {trajectory.frames} frames did not converge; first {reason}"
    return status, ("" if status == "ok" else reason)
