"""One cell, in a process of its own: prepare off the clock, run on it, write the raw trajectory.

Metrics come later, from the files. The process loads what its scene and method need and nothing else; the
modules of ours and the heavy ones that it has loaded are in its record.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .clock import Reading, clocked
from .method import MethodEntry
from .results import RunFolder

if TYPE_CHECKING:
    import numpy as np

    from reference_sim import Trajectory

    from .plan import Cell
    from .presets import Preset
    from .scene import BuiltScene
    from .wardrobe import Wardrobe

# What a trajectory says of itself, in the words of a result row. A solver cut short on purpose is ok.
WORDS = {"converged": "ok", "ok": "ok", "stalled": "stalled", "diverged": "diverged", "timeout": "timeout"}
OURS = ("reference_sim", "snug", "benchmarks")
HEAVY = ("torch", "igl", "numba", "scipy", "h5py")  # what a scene may do without
_SCENES: dict[str, BuiltScene] = {}  # of this process, which has one
_BATCHES: dict[str, Callable[[int], Callable[[], np.ndarray]]] = {}  # and of its cell, where it has one
BATCH = 16  # bodies at once, where a method can


@dataclass(frozen=True)
class Outcome:
    """How a cell ended. A cell that is not recorded has left no trajectory.

    seconds: of run(), on the clock, repeats included. frames: those it computed. batch_seconds: per frame,
    many at once. peak: most memory of the process until its run had ended [MB]. modules: all that it has
    loaded. terms: the energies of the scene, joined by "+". commit: of the code that ran it, where that was
    an earlier run.
    """

    cell: Cell
    status: str
    reason: str = ""
    seconds: tuple[float, ...] = ()
    frames: int = 0
    batch_seconds: float | None = None
    peak: float | None = None
    modules: tuple[str, ...] = ()
    terms: str = ""
    recorded: bool = False
    commit: str = ""


@dataclass(frozen=True, kw_only=True)
class Task:
    """All that a cell's process is told; what is ready made lies in files."""

    cell: Cell
    entry: MethodEntry
    preset: Preset
    wardrobe: Wardrobe | None
    folder: Path


def perform(task: Task) -> Outcome:
    """Build the scene and run the cell in this process, whose memory and modules are looked at afterwards."""
    try:
        scene = _SCENES[task.cell.scene.name] = built(task)
        outcome = run_cell(task.cell, task.entry, scene, RunFolder(task.folder))
    except Exception as error:
        outcome = failed(task.cell, error)
    peak = outcome.peak if outcome.recorded else peak_memory()
    return dataclasses.replace(outcome, peak=peak, modules=loaded())


def perform_many(task: Task) -> Outcome:
    """Take the time of many bodies at once, where the method that this process has run can do them."""
    ready = _BATCHES.pop(task.cell.label, None)
    if ready is None:
        return Outcome(task.cell, "ok")
    try:
        seconds, complaint = throughput(ready(BATCH))
    except Exception as error:
        return failed(task.cell, error)
    return Outcome(task.cell, "failed" if complaint else "ok", complaint, batch_seconds=seconds)


def perform_again(task: Task) -> Outcome:
    """Take the time of one more run, in the scene that this process has built."""
    try:
        scene = _SCENES.get(task.cell.scene.name) or built(task)
        models = RunFolder(task.folder).models_of(task.cell.scene.garment)
        method = task.entry.make(models=models, seed=task.cell.seed)
        method.prepare(scene)
        _, reading = clocked(method.run, of=lambda made: made.positions)
    except Exception as error:
        return failed(task.cell, error)
    status = "failed" if reading.complaint else "ok"
    return Outcome(task.cell, status, reading.complaint, (reading.seconds,))


def built(task: Task) -> BuiltScene:
    """The scene, a dressed one with the start and the posed body that the run's folder has ready."""
    scene = task.cell.scene
    if not scene.dressed or task.wardrobe is None:
        return scene.build(task.preset, task.wardrobe)
    import numpy as np

    run, motion = RunFolder(task.folder), scene.name.split("/", 1)[1]
    bodies = {motion: np.load(run.body_path(scene.name))}
    start = np.load(run.start_path(scene.name))
    dressed = scene.build(task.preset, dataclasses.replace(task.wardrobe, bodies=bodies))
    return dataclasses.replace(dressed, settle=lambda: start)


def run_cell(cell: Cell, entry: MethodEntry, scene: BuiltScene, run: RunFolder) -> Outcome:
    """Prepare off the clock, run on it, write the trajectory. Whatever is raised becomes a failed outcome.

    What many bodies at once take is asked for afterwards, by perform_many.
    """
    if reason := entry.skip(cell.scene):
        return Outcome(cell, "skipped", reason)
    path = run.trajectory_path(cell.scene.name, cell.method, cell.seed)
    try:
        method = entry.make(models=run.models_of(cell.scene.garment), seed=cell.seed)
        method.prepare(scene)
        trajectory, reading = clocked(method.run, of=lambda made: made.positions)
        peak = peak_memory()  # many bodies at once, and poses held still, are not what others are compared by
        status, reason = judge(trajectory, reading, scene, cut_short=entry.cut_short)
        if status == "failed":
            return Outcome(cell, status, reason)
        path.parent.mkdir(parents=True, exist_ok=True)
        provenance = {"run_seconds": reading.seconds, "scene": scene.name, "seed": cell.seed}
        dataclasses.replace(trajectory, provenance=trajectory.provenance | provenance).save(path)
        held = getattr(method, "held", None)
        if held is not None:
            held().save(run.held_path(cell.scene.name, cell.method, cell.seed))
        if hasattr(method, "ready_batch"):
            _BATCHES[cell.label] = method.ready_batch
    except Exception as error:
        for left in (path, run.held_path(cell.scene.name, cell.method, cell.seed)):
            left.unlink(missing_ok=True)  # nobody is to look at the frames of a cell that failed
        return failed(cell, error)
    frames = frames_computed(trajectory)
    return Outcome(
        cell, status, reason, (reading.seconds,), frames, peak=peak, terms="+".join(scene.terms),
        recorded=True,
    )  # fmt: skip


def throughput(run: Callable[[], np.ndarray]) -> tuple[float, str]:
    """Seconds per frame of a method that computes many bodies at once, (T, copies, V, 3).

    And why they cannot be believed, or nothing.
    """
    positions, reading = clocked(run, of=lambda made: made)
    complaint = f"its time cannot be believed: {reading.complaint}" if reading.complaint else ""
    return reading.seconds / (positions.shape[0] * positions.shape[1]), complaint


def judge(trajectory: Trajectory, reading: Reading, scene: BuiltScene, *, cut_short: bool) -> tuple[str, str]:
    """Status and reason of a row, from what the trajectory says of itself, what is in it, and the clock."""
    import numpy as np

    reason = " ".join(trajectory.reason.split())
    if reading.complaint:
        return "failed", f"its time cannot be believed: {reading.complaint}"
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


def frames_computed(trajectory: Trajectory) -> int:
    """Frames that the run has made: a simulator is given the first one, and takes no time for it."""
    given = not trajectory.frame_seconds[0] > 0.0  # zero or nan
    return max(trajectory.frames - int(given), 1)


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


def loaded() -> tuple[str, ...]:
    """Modules of ours, and the heavy packages, that this process has loaded."""
    ours = {name for name in sys.modules if name.split(".")[0] in OURS}
    return tuple(sorted(ours | {name for name in HEAVY if name in sys.modules}))


def failed(cell: Cell, error: Exception) -> Outcome:
    """The outcome of a cell that raised. torch's allocator on a CPU raises a plain RuntimeError."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    memory = isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError"
    memory = memory or "DefaultCPUAllocator" in text
    return Outcome(cell, "out-of-memory" if memory else "failed", text)
