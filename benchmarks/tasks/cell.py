"""One cell, in a process of its own: prepare off the clock, run on it, write the raw trajectory.

Metrics come later, from the files. The process loads what its scene and method need and nothing else; the
modules of ours and the heavy ones that it has loaded are in the result.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..method import Method, MethodEntry
from ..results import RunFolder
from ..scene import BuiltScene, Scene
from ..timing import Reading, clocked
from .task import Context, Outcome, Task, TaskId, failure

if TYPE_CHECKING:
    from reference_sim import Trajectory

    from ..assets import Assets

# What a trajectory says of itself, in the words of a result row. A solver stopped on purpose is ok.
WORDS = {"converged": "ok", "ok": "ok", "stalled": "stalled", "diverged": "diverged", "timeout": "timeout"}
OURS = ("reference_sim", "snug", "benchmarks")
HEAVY = ("torch", "igl", "numba", "scipy", "h5py")  # what a scene may do without
BATCH = 16  # bodies at once, where a method can
UNBELIEVABLE = "its time cannot be believed: "


@dataclass(frozen=True)
class Cell:
    """One scene met by one method with one seed; `suites` are those that report it."""

    scene: Scene
    entry: MethodEntry
    seed: int
    suites: tuple[str, ...]

    @property
    def method(self) -> str:
        return self.entry.name

    @property
    def label(self) -> str:
        return f"{self.scene.name} x {self.method}" + (f" (seed {self.seed})" if self.seed else "")

    @property
    def name(self) -> str:
        """<scene>/<method>, and the seed where it is not 0: as part of a path."""
        return f"{flat(self.scene.name)}/{flat(self.method)}" + (f"-seed{self.seed}" if self.seed else "")

    def trajectory(self, folder: RunFolder) -> Path:
        return folder.trajectory_path(self.scene.name, self.method, self.seed)

    def quasi_static(self, folder: RunFolder) -> Path:
        return folder.quasi_static_path(self.scene.name, self.method, self.seed)


def flat(name: str) -> str:
    """A name as part of a path."""
    return name.replace("/", "-")


@dataclass(frozen=True, kw_only=True, eq=False)
class CellTask(Task):
    """What the run of a cell, its repeats and its batch have in common: a process with scene and method."""

    stage = "cells"
    unit = "cell"
    cell: Cell

    def assets(self, assets: Assets | None) -> Assets | None:
        return assets.only(self.cell.scene.motion) if assets is not None and self.cell.scene.dressed else None

    def scene(self, context: Context) -> BuiltScene:
        """The built scene of this process."""
        if "scene" not in context.memo:
            context.memo["scene"] = built(self.cell.scene, context)
        return context.memo["scene"]

    def ready(self, context: Context) -> Method:
        """A fresh method, prepared."""
        cell = self.cell
        method = cell.entry.make(models=context.folder.models_of(cell.scene.garment), seed=cell.seed)
        method.prepare(self.scene(context))
        return method


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCell(CellTask):
    """The trajectory of a method in a scene, timed once."""

    kind = "cell"

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        return self.cell.entry.skip(self.cell.scene) or ""

    def clear(self, folder: RunFolder) -> None:
        self.cell.trajectory(folder).unlink(missing_ok=True)
        self.cell.quasi_static(folder).unlink(missing_ok=True)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Prepare off the clock, run on it, write. Memory is that until the run has ended."""
        try:
            outcome = self._run(context)
        except Exception as error:
            self.clear(context.folder)  # nobody is to look at the frames of a cell that failed
            outcome = dataclasses.replace(failure(error), result={"peak": peak_memory()})
        return dataclasses.replace(outcome, result={**outcome.result, "modules": loaded()})

    def _run(self, context: Context) -> Outcome:
        cell, folder = self.cell, context.folder
        scene, method = self.scene(context), self.ready(context)
        if cell.scene.timed:
            trajectory, reading = clocked(method.run, of=lambda made: made.positions)
        else:
            trajectory, reading = method.run(), Reading(math.nan)
        peak = peak_memory()  # many bodies at once, and poses held still, are not what others are compared by
        status, reason = judge(trajectory, reading, scene, truncated=cell.entry.truncated)
        result: dict[str, Any] = {
            "seconds": reading.seconds,
            "frames": max(trajectory.frames - (not cell.entry.gives_first_frame), 1),
            "peak": peak,
            "terms": "+".join(scene.terms),
        }
        if status == "failed":
            return Outcome(status, reason, failed=True, result={"peak": peak})
        paths = [cell.trajectory(folder)]
        paths[0].parent.mkdir(parents=True, exist_ok=True)
        provenance = {"run_seconds": reading.seconds, "scene": scene.name, "seed": cell.seed}
        dataclasses.replace(trajectory, provenance=trajectory.provenance | provenance).save(paths[0])
        quasi_static = method.quasi_static() if cell.scene.dynamic or not cell.scene.dressed else None
        if quasi_static is not None:
            paths.append(cell.quasi_static(folder))
            quasi_static.save(paths[1])
        context.memo["method"] = method
        return Outcome(status, reason, result=result, files=tuple(map(folder.relative, paths)))


@dataclass(frozen=True, kw_only=True, eq=False)
class RunUntimedCell(RunCell):
    """The same beside others, where nobody asks for the time."""

    stage = "cells that are not timed"


@dataclass(frozen=True, kw_only=True, eq=False)
class BatchCell(CellTask):
    """The time of many bodies at once, by the method that this process has run."""

    kind = "batch"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        method = context.memo.get("method") or self.ready(context)
        positions, reading = clocked(method.batch(BATCH), of=lambda made: made)
        seconds = reading.seconds / (positions.shape[0] * positions.shape[1])
        result = {"seconds": seconds, "complaint": reading.complaint}
        if reading.complaint:
            return Outcome("failed", UNBELIEVABLE + reading.complaint, result=result)
        return Outcome(result=result)


@dataclass(frozen=True, kw_only=True, eq=False)
class RepeatCell(CellTask):
    """The same once more, for its time alone. longest: [s] of a first run that is repeated."""

    kind = "repeat"
    longest: float

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        first = next(iter(needed.values()), Outcome())
        too_long = first.result.get("seconds", 0.0) > self.longest
        return "the first run took too long" if too_long else first.remark

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        method = self.ready(context)
        _, reading = clocked(method.run, of=lambda made: made.positions)
        if reading.complaint:
            return Outcome("failed", reading.complaint, result={"seconds": reading.seconds})
        return Outcome(result={"seconds": reading.seconds})


def built(scene: Scene, context: Context) -> BuiltScene:
    """The scene, a dressed one with the start and the posed body that the run's folder has ready."""
    run, assets = context.folder, context.assets
    if assets is None or not run.body_path(scene.name).is_file():
        return scene.build(assets)
    import numpy as np

    bodies = {assets.motion(scene.motion, scene.part).name: np.load(run.body_path(scene.name))}
    start = np.load(run.start_path(scene.name))
    dressed = scene.build(dataclasses.replace(assets, bodies=bodies))
    return dataclasses.replace(dressed, settle=lambda: start)


def judge(trajectory: Trajectory, reading: Reading, scene: BuiltScene, *, truncated: bool) -> tuple[str, str]:
    """Status and reason of a row, from what the trajectory says of itself, what is in it, and the clock."""
    import numpy as np

    reason = " ".join(trajectory.reason.split())
    if reading.complaint:
        return "failed", UNBELIEVABLE + reading.complaint
    if not np.isfinite(trajectory.positions).all():
        return "diverged", reason or "a position is not finite"
    if trajectory.frames < scene.frames:
        return "diverged", reason or f"ended after {trajectory.frames} of {scene.frames} frames"
    if trajectory.status == "max_iterations":
        return ("ok", "") if truncated else ("stalled", reason)
    if trajectory.status not in WORDS:
        return "failed", f"unknown status '{trajectory.status}', use one of {', '.join(WORDS)}; {reason}"
    status = WORDS[trajectory.status]
    if status != "ok" and "converged" in trajectory.frame_fields:
        bad = int((trajectory.frame_fields["converged"] < 0.5).sum())
        reason = f"{bad} of {trajectory.frames} frames did not converge; first {reason}"
    return status, ("" if status == "ok" else reason)


def peak_memory() -> float:
    """Most memory that this process has held at once [MB].

    Linux keeps it per memory image; ru_maxrss there would still hold what the parent had before this process
    loaded its own program.
    """
    import resource

    try:
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass  # not Linux
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024) / 1e6


def loaded() -> list[str]:
    """Modules of ours, and the heavy packages, that this process has loaded."""
    ours = {name for name in sys.modules if name.split(".")[0] in OURS}
    return sorted(ours | {name for name in HEAVY if name in sys.modules})
