"""One cell, in a process of its own: prepare off the clock, run on it, write the raw trajectory.

Metrics come later, from the files. The process loads what its scene and method need and nothing else; the
modules of ours and the heavy ones that it has loaded are in the result.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from benchmarks.method import Method
from benchmarks.plan.cell import Cell, TaskId
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task import Context, Outcome, Task, failure
from benchmarks.scene import BuiltScene, Scene
from benchmarks.timing import Reading, clocked, peak_memory

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.assets import Assets
    from benchmarks.validation.case import Case
    from reference_sim import Trajectory

# Status of a trajectory -> status of a result row. A solver stopped on purpose is ok.
STATUS_OF = {
    "converged": "ok",
    "ok": "ok",
    "stalled": "stalled",
    "diverged": "diverged",
    "timeout": "timeout",
}
OURS = ("reference_sim", "snug", "benchmarks")
HEAVY = ("torch", "igl", "numba", "scipy", "h5py")  # what a scene may do without
BATCH = 16  # bodies at once, where a method can
INPUTS = 0.1  # of the time measured of a run, for its inputs: a few equal milliseconds a frame
SHORT = 0.05  # of the time of a simulation that was not stopped early
UNBELIEVABLE = "its time cannot be believed: "


@dataclass
class CellProcess:
    """State that the tasks of one cell share in their process.

    A method is kept between tasks because preparing it takes far longer than many of its runs.

    Attributes:
        scene: as built.
        prepared: a method that `begin` has prepared, until a run takes it.
        finished: the method of the cell's run, which BatchCell goes on with.
    """

    scene: BuiltScene | None = None
    prepared: Method | None = None
    finished: Method | None = None

    @classmethod
    def of(cls, context: Context) -> CellProcess:
        """Return the state of this process."""
        return context.memo.setdefault(cls, cls())


@dataclass(frozen=True, kw_only=True, eq=False)
class CellTask(Task):
    """Base of the run of a cell, its repeats and its batch: they share scene and method in one process.

    least: [s] to be measured.
    """

    stage = "cells"
    unit_seconds = 2.0
    cell: Cell
    least: float = 0.0

    def assets(self, assets: Assets | None) -> Assets | None:
        """Return the assets of the cell's motion."""
        return assets.only(self.cell.scene.motion) if assets is not None and self.cell.scene.dressed else None

    def scene(self, context: Context) -> BuiltScene:
        """Return the scene, built once in a process."""
        process = CellProcess.of(context)
        if process.scene is None:
            process.scene = build_scene(self.cell.scene, context)
        return process.scene

    def begin(self, context: Context) -> None:
        """Prepare a method of the project, which is still until it is run.

        What a user's method leaves at work would count against whoever is timed meanwhile.
        """
        if not self.cell.entry.declared_in:
            CellProcess.of(context).prepared = self.prepared_method(context)

    def prepared_method(self, context: Context) -> Method:
        """Return a method that is prepared and has not run."""
        cell, process = self.cell, CellProcess.of(context)
        if (method := process.prepared) is not None:
            process.prepared = None
            return method
        method = cell.entry.make(models=context.folder.models_of(cell.scene.garment), seed=cell.seed)
        method.prepare(self.scene(context))
        return method

    def timed(self, method: Method, least: float) -> tuple[Trajectory, Reading, list[np.ndarray]]:
        """Return the trajectory, the time of each run, and the times (T,) [s] it states for its frames."""
        frames = []

        def run() -> Trajectory:
            made = method.run()
            frames.append(made.frame_seconds)
            return made

        made, reading = clocked(run, of=lambda made: made.positions, least=least)
        return made, reading, frames[-len(reading.runs) :]  # a first run that compiled is not among them

    def times(self, reading: Reading, frames: list[np.ndarray]) -> dict[str, float]:
        """Return times [s] of the median run, and of its median, 95 % and slowest frame."""
        import numpy as np

        result = {"seconds": reading.seconds, "runs": len(reading.runs)}
        # Each frame by its median run: else the more runs, the slower the slowest frame.
        frame = np.median(np.stack(frames), axis=0)[not self.cell.entry.gives_first_frame :]
        if frame.size and not np.isnan(frame).any():
            p50, p95 = np.percentile(frame, (50, 95))
            result |= {"frame_p50": float(p50), "frame_p95": float(p95), "frame_worst": float(frame.max())}
        return result


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCell(CellTask):
    """The trajectory of a method in a scene, timed, and the time of its inputs."""

    kind = "cell"

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        """Return why the method cannot do the scene, or empty."""
        return self.cell.entry.skip(self.cell.scene) or ""

    def clear(self, folder: RunFolder) -> None:
        """Remove the files of an earlier run of the cell."""
        folder.trajectory_path(*self.cell.key).unlink(missing_ok=True)
        folder.curves_path(*self.cell.key).unlink(missing_ok=True)
        folder.quasi_static_path(*self.cell.key).unlink(missing_ok=True)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Prepare off the clock, run on it, write the trajectory; memory is that until the run has ended."""
        try:
            outcome = self._run(context)
        except Exception as error:
            self.clear(context.folder)  # nobody is to look at the frames of a cell that failed
            outcome = replace(failure(error), result={"peak": peak_memory()})
        context.tell(self.units)
        return replace(outcome, result={**outcome.result, "modules": loaded()})

    def _run(self, context: Context) -> Outcome:
        cell, folder = self.cell, context.folder
        scene, method = self.scene(context), self.prepared_method(context)
        if cell.timed:
            trajectory, reading, frames = self.timed(method, 0.0)
        else:
            trajectory, reading = method.run(), Reading((math.nan,))
        peak = peak_memory()  # what follows, as many bodies at once, is not what others are compared by
        result: dict[str, float | str] = {
            "seconds": reading.seconds,
            "frames": max(trajectory.frames - (not cell.entry.gives_first_frame), 1),
            "peak": peak,
            "terms": "+".join(scene.terms),
        }
        if "declared_ms" in trajectory.provenance:
            result["declared_ms"] = trajectory.provenance["declared_ms"]
        if cell.timed and not reading.complaint:
            if reading.seconds < self.least:
                _, again, further = self.timed(method, self.least - reading.seconds)
                reading, frames = Reading(reading.runs + again.runs, again.complaint), frames + further
            inputs = clocked_inputs(method, scene, least=INPUTS * self.least)
            result |= self.times(reading, frames) | {"inputs": inputs.seconds}
            reading = replace(reading, complaint=reading.complaint or inputs.complaint)
        status, reason = judge(
            trajectory, reading, scene, truncated=cell.entry.truncated, other_mesh=cell.entry.other_mesh
        )
        if status == "failed":
            return Outcome(status, reason, failed=True, result={"peak": peak})
        paths = [folder.trajectory_path(*cell.key)]
        paths[0].parent.mkdir(parents=True, exist_ok=True)
        provenance = {"run_seconds": reading.seconds, "scene": scene.name, "seed": cell.seed}
        replace(trajectory, provenance=trajectory.provenance | provenance).save(paths[0])
        quasi_static = method.quasi_static() if cell.scene.dynamic or not cell.scene.dressed else None
        if quasi_static is not None:
            if wrong := misshapen(quasi_static.positions, scene):
                raise ValueError(f"quasi_static() {wrong}")
            paths.append(folder.quasi_static_path(*cell.key))
            quasi_static.save(paths[1])
        CellProcess.of(context).finished = method
        return Outcome(status, reason, result=result, files=tuple(map(folder.relative, paths)))


@dataclass(frozen=True, kw_only=True, eq=False)
class RunUntimedCell(RunCell):
    """The trajectory of a cell whose time nobody asks for: it runs beside others."""

    stage = "cells that are not timed"
    unit_seconds = 7.0  # of a simulation to convergence

    @property
    def expected_seconds(self) -> float:
        """Expected duration [s]: networks and solvers that stop early take a small part of a simulation's."""
        short = self.cell.entry.trained or self.cell.entry.truncated
        return super().expected_seconds * (SHORT if short else 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class BatchCell(CellTask):
    """The time of many bodies at once, by the method that this process has run."""

    kind = "batch"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Time the batch."""
        method = CellProcess.of(context).finished or self.prepared_method(context)
        positions, reading = clocked(method.batch(BATCH), of=lambda made: made, least=self.least)
        seconds = reading.seconds / (positions.shape[0] * positions.shape[1])
        result = {"seconds": seconds, "complaint": reading.complaint}
        if reading.complaint:
            return Outcome("failed", UNBELIEVABLE + reading.complaint, result=result)
        return Outcome(result=result)


@dataclass(frozen=True, kw_only=True, eq=False)
class RepeatCell(CellTask):
    """One more run of a cell, for its time alone. longest: [s] of a first run that is repeated."""

    kind = "repeat"
    unit_seconds = 0.5
    longest: float

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        """Return why the cell is not run again, or empty."""
        first = next(iter(needed.values()), Outcome())
        too_long = first.result.get("seconds", 0.0) > self.longest
        return "the first run took too long" if too_long else first.remark

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Time another run."""
        _, reading, frames = self.timed(self.prepared_method(context), self.least)
        if reading.complaint:
            return Outcome("failed", reading.complaint, result={"seconds": reading.seconds})
        return Outcome(result=self.times(reading, frames))


def build_scene(scene: Scene, context: Context) -> BuiltScene:
    """Return the built scene, a dressed one with the start and the posed body of the run's folder."""
    run, assets = context.folder, context.assets
    if assets is None or not run.body_path(scene.name).is_file():
        return scene.build(assets)
    from reference_sim.files.array_file import read_array

    bodies = {assets.motion(scene.motion, scene.part).name: read_array(run.body_path(scene.name))}
    start = read_array(run.start_path(scene.name))
    dressed = scene.build(replace(assets, bodies=bodies))
    return replace(dressed, settle=lambda: start)


def clocked_inputs(method: Method, scene: BuiltScene, *, least: float) -> Reading:
    """[s] a frame of what run() takes as ready, made frame after frame, as poses come in."""
    import numpy as np

    make = method.inputs(scene)
    if make is None or scene.dressed is None:
        return Reading((0.0,))
    frames = scene.dressed.motion.frames

    def all_frames() -> np.ndarray:
        for frame in range(frames):
            make(frame)
        return np.zeros(1)

    make(0)  # whatever is loaded or compiled at first
    _, reading = clocked(all_frames, of=lambda made: made, least=least)
    return replace(reading, runs=tuple(seconds / frames for seconds in reading.runs))


def judge(
    trajectory: Trajectory, reading: Reading, scene: BuiltScene, *, truncated: bool, other_mesh: bool = False
) -> tuple[str, str]:
    """Status and reason of a row, from what the trajectory says of itself, what is in it, and the clock."""
    import numpy as np

    reason = " ".join(trajectory.reason.split())
    if wrong := misshapen(trajectory.positions, scene, other_mesh=other_mesh):
        return "failed", f"run() {wrong}"
    if reading.complaint:
        return "failed", UNBELIEVABLE + reading.complaint
    if not np.isfinite(trajectory.positions).all():
        return "diverged", reason or "a position is not finite"
    if trajectory.frames < scene.frames:
        ended = "timeout" if trajectory.status == "timeout" else "diverged"
        return ended, reason or f"ended after {trajectory.frames} of {scene.frames} frames"
    if trajectory.status == "max_iterations":
        return ("ok", "") if truncated else ("stalled", reason)
    if trajectory.status not in STATUS_OF:
        return "failed", f"unknown status '{trajectory.status}', use one of {', '.join(STATUS_OF)}; {reason}"
    status = STATUS_OF[trajectory.status]
    if status != "ok" and not truncated and "converged" in trajectory.frame_fields:
        bad = int((trajectory.frame_fields["converged"] < 0.5).sum())
        reason = f"{bad} of {trajectory.frames} frames did not converge; {reason}"
    return status, reason


def misshapen(positions: np.ndarray, scene: BuiltScene, *, other_mesh: bool = False) -> str:
    """Why these are no positions (T,V,3) of the scene, or empty. There may be fewer frames, and no more.

    other_mesh: whether there may be another number of vertices.
    """
    import numpy as np

    x = np.asarray(positions)
    shape = (scene.frames, x.shape[1] if other_mesh else scene.cloth.vertex_count, 3)
    if x.dtype.kind == "f" and x.shape[1:] == shape[1:] and len(x) <= shape[0]:
        return ""
    return f"gives positions {x.dtype} {x.shape}: floats {shape} are due, the start included"


def loaded() -> list[str]:
    """Modules of ours, and the heavy packages, that this process has loaded."""
    ours = {name for name in sys.modules if name.split(".")[0] in OURS}
    return sorted(ours | {name for name in HEAVY if name in sys.modules})


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCase(Task):
    """The row of one case."""

    kind = "case"
    stage = "validation"
    unit_seconds = 0.2
    case: Case

    def warm_up(self) -> None:
        """Compile what the case needs."""
        self.case.warm_up()

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Run the case; its row is the result."""
        row = self.case.run()
        context.tell(self.units)
        return Outcome(row.status, row.reason, failed=row.status != "ok", result=dataclasses.asdict(row))

    def rows(self, outcome: Outcome) -> list[Row]:
        """Return the row of the case, also of one that died or hung.

        A hang and a crash are failures of the solver: only one that ends by itself may call it a timeout.
        """
        if outcome.result:
            return [Row(**outcome.result)]
        return [self.case.row(status="failed", reason=outcome.reason)]
