"""One cell, in a process of its own: prepare off the clock, run on it, write the raw trajectory.

Metrics come later, from the files. The process loads what its scene and method need alone.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from benchmarks.method import Method, MethodEntry
from benchmarks.plan.cell import Cell
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task import Context, Needed, Outcome, failure
from benchmarks.scene import BuiltScene, Scene
from benchmarks.timing import Reading, peak_memory, time_run

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.validation.case import Case
    from reference_sim import Trajectory

STATUSES = ("converged", "ok", "stalled", "diverged", "timeout")  # of a trajectory
BATCH = 16  # bodies at once, where a method can
# Share of a run's measured time for its inputs: a few equal milliseconds a frame.
INPUTS = 0.1
UNBELIEVABLE = "its time cannot be believed: "


def prepare_method(cell: Cell, context: Context) -> Method:
    """Return a prepared method that has not run."""
    method = cell.entry.make(models=context.folder.models_of(cell.scene.garment), seed=cell.seed)
    method.prepare(build_scene(cell.scene, context))
    return method


def clock(method: Method, min_time: float) -> tuple[Trajectory, Reading, list[np.ndarray]]:
    """Return trajectory, time of each run, and the times (T,) [s] it states for its frames."""
    frames = []

    def run() -> Trajectory:
        trajectory = method.run()
        frames.append(trajectory.frame_seconds)
        return trajectory

    trajectory, reading = time_run(run, read=lambda trajectory: trajectory.positions, min_time=min_time)
    # A first run that compiled is none of them.
    return trajectory, reading, frames[-len(reading.runs) :]


def times(cell: Cell, reading: Reading, frames: list[np.ndarray]) -> dict[str, float]:
    """Return times [s] of the median run, and of its median, 95 % and slowest frame."""
    import numpy as np

    result = {"seconds": reading.seconds, "runs": len(reading.runs)}
    # Each frame by its median run: else the more runs, the slower the slowest frame.
    frame = np.median(np.stack(frames), axis=0)[not cell.entry.gives_first_frame :]
    if frame.size and not np.isnan(frame).any():
        p50, p95 = np.percentile(frame, (50, 95))
        result |= {"frame_p50": float(p50), "frame_p95": float(p95), "frame_worst": float(frame.max())}
    return result


def run_cell(cell: Cell, min_time: float, context: Context, outcomes: Needed) -> Outcome:
    """Return the outcome of a cell: its trajectory, timed for `min_time` [s], and inputs."""
    try:
        return compute_cell(cell, min_time, context)
    except Exception as error:
        # Nobody is to look at frames of a failed cell.
        for name in files_of(cell, context.folder):
            (context.folder.path / name).unlink(missing_ok=True)
        return replace(failure(error), result={"peak": peak_memory()})


def files_of(cell: Cell, folder: RunFolder) -> tuple[str, ...]:
    """Return the names of the files of a cell and its measurement in the run's folder."""
    paths = (folder.trajectory_path, folder.curves_path, folder.quasi_static_path)
    return tuple(folder.relative(path(*cell.key)) for path in paths)


def compute_cell(cell: Cell, min_time: float, context: Context) -> Outcome:
    """Prepare off the clock, run on it, write the trajectory; memory is until the run ends."""
    import numpy as np

    folder = context.folder
    scene, method = build_scene(cell.scene, context), prepare_method(cell, context)
    if cell.timed:
        trajectory, reading, frames = clock(method, 0.0)
    else:
        trajectory, reading = method.run(), Reading((math.nan,))
    peak = peak_memory()  # what follows, as many bodies at once, is not compared
    result: dict[str, float | str] = {
        "seconds": reading.seconds,
        "frames": max(trajectory.frames - (not cell.entry.gives_first_frame), 1),
        "peak": peak,
        "terms": "+".join(scene.terms),
    }
    if "declared_ms" in trajectory.provenance:
        result["declared_ms"] = trajectory.provenance["declared_ms"]
    if cell.timed and not reading.complaint:
        if reading.seconds < min_time:
            _, rerun, tail = clock(method, min_time - reading.seconds)
            reading = Reading(reading.runs + rerun.runs, rerun.complaint)
            frames += tail
        inputs = time_inputs(method, scene, min_time=INPUTS * min_time)
        result |= times(cell, reading, frames) | {"inputs": inputs.seconds}
        reading = replace(reading, complaint=reading.complaint or inputs.complaint)
    status, reason = judge(trajectory, reading, scene, cell.entry)
    if status == "failed":
        return Outcome(status, reason, failed=True, result={"peak": peak})
    paths = [folder.trajectory_path(*cell.key)]
    provenance = {"run_seconds": reading.seconds, "scene": scene.name, "seed": cell.seed}
    replace(trajectory, provenance=trajectory.provenance | provenance).save(paths[0])
    quasi_static = method.quasi_static() if cell.scene.dynamic or not cell.scene.dressed else None
    if quasi_static is not None:
        if fault := misshapen(quasi_static.positions, scene):
            raise ValueError(f"quasi_static() {fault}")
        same = np.array_equal(quasi_static.positions, trajectory.positions)  # one file serves for both
        paths.append(paths[0] if same else folder.quasi_static_path(*cell.key))
        if not same:
            quasi_static.save(paths[1])
    context.memo["method"] = method
    return Outcome(status, reason, result=result, files=tuple(map(folder.relative, paths)))


def time_batch(cell: Cell, min_time: float, context: Context, outcomes: Needed) -> Outcome:
    """Return the time of many bodies at once, by the method that this process has run."""
    method = context.memo.get("method") or prepare_method(cell, context)
    positions, reading = time_run(method.batch(BATCH), read=lambda x: x, min_time=min_time)
    seconds = reading.seconds / (positions.shape[0] * positions.shape[1])
    result = {"seconds": seconds, "complaint": reading.complaint}
    if reading.complaint:
        return Outcome("failed", UNBELIEVABLE + reading.complaint, result=result)
    return Outcome(result=result)


def repeat_cell(limit: float, cell: Cell, min_time: float, context: Context, outcomes: Needed) -> Outcome:
    """Return the time of one more run of a cell whose first took at most `limit` [s]."""
    if outcomes[cell.id()].result["seconds"] > limit:
        return Outcome("skipped", "the first run took too long")
    _, reading, frames = clock(prepare_method(cell, context), min_time)
    if reading.complaint:
        return Outcome("failed", reading.complaint, result={"seconds": reading.seconds})
    return Outcome(result=times(cell, reading, frames))


def build_scene(scene: Scene, context: Context) -> BuiltScene:
    """Return the scene, built once a batch; a dressed one with the start in the folder."""
    run, assets = context.folder, context.assets
    if "scene" in context.memo:
        return context.memo["scene"]
    built = scene.build(assets)
    if assets and run.start_path(scene.name).is_file():
        import numpy as np

        start = np.load(run.start_path(scene.name))
        built = replace(built, settle=lambda: start)
    context.memo["scene"] = built
    return built


def time_inputs(method: Method, scene: BuiltScene, *, min_time: float) -> Reading:
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
    _, reading = time_run(all_frames, read=lambda x: x, min_time=min_time)
    return replace(reading, runs=tuple(seconds / frames for seconds in reading.runs))


def judge(
    trajectory: Trajectory, reading: Reading, scene: BuiltScene, entry: MethodEntry
) -> tuple[str, str]:
    """Return status and reason of a row, by trajectory and clock."""
    import numpy as np

    reason = " ".join(trajectory.reason.split())
    if fault := misshapen(trajectory.positions, scene, other_mesh=entry.other_mesh):
        return "failed", f"run() {fault}"
    if reading.complaint:
        return "failed", UNBELIEVABLE + reading.complaint
    if not np.isfinite(trajectory.positions).all():
        return "diverged", reason or "a position is not finite"
    if trajectory.frames < scene.frames:
        ended = "timeout" if trajectory.status == "timeout" else "diverged"
        return ended, reason or f"ended after {trajectory.frames} of {scene.frames} frames"
    if trajectory.status == "max_iterations":
        return ("ok", "") if entry.truncated else ("stalled", reason)
    if trajectory.status not in STATUSES:
        names = ", ".join(STATUSES)
        return "failed", f"unknown status '{trajectory.status}', use one of {names}; {reason}"
    status = "ok" if trajectory.status == "converged" else trajectory.status
    if status != "ok" and not entry.truncated and "converged" in trajectory.frame_fields:
        bad = int((trajectory.frame_fields["converged"] < 0.5).sum())
        reason = f"{bad} of {trajectory.frames} frames did not converge; {reason}"
    return status, reason


def misshapen(positions: np.ndarray, scene: BuiltScene, *, other_mesh: bool = False) -> str:
    """Why these are no positions (T,V,3) of the scene, or empty. Fewer frames may be there.

    other_mesh: whether there may be another number of vertices.
    """
    import numpy as np

    x = np.asarray(positions)
    count = x.shape[1] if other_mesh and x.ndim == 3 else scene.cloth.vertex_count
    shape = (scene.frames, count, 3)
    if x.dtype.kind == "f" and x.shape[1:] == shape[1:] and len(x) <= shape[0]:
        return ""
    return f"gives positions {x.dtype} {x.shape}: floats {shape} are due, the start included"


def run_case(case: Case, context: Context, outcomes: Needed) -> Outcome:
    """Return the outcome of a case; its row is the result."""
    row = case.run()
    return Outcome(row.status, row.reason, failed=row.status != "ok", result=dataclasses.asdict(row))
