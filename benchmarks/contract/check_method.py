"""Check of a method: whether it keeps the contract of benchmarks.method, in one scene and its own process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from benchmarks.cell import TaskId
from benchmarks.contract.findings import Broken, Connections, Findings, altered, fingerprints
from benchmarks.method import Method
from benchmarks.process.timing import Reading, clocked
from benchmarks.scene import BuiltScene
from benchmarks.tasks.cell_task import UNBELIEVABLE, CellTask, judge, misshapen
from benchmarks.tasks.task import Context, Outcome

if TYPE_CHECKING:
    from reference_sim import Trajectory

LEAST_MEASURED = 0.02  # [s] to be measured: run() is called twice at least, unless it takes longer
COPIES = 3  # bodies at once
PLACE_TOLERANCE = 1e-6  # [m] of what should be in its place; times a frame's length in float32
CLOCK_SLACK = 1.1  # of the clock: what frames say of themselves may be more by so much, in all


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckMethod(CellTask):
    """Call everything that the harness asks of a method once; the findings are in the result."""

    kind = "check"
    stage = "check"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Check, and return the findings as the result."""
        entry = self.cell.entry
        findings, watched = Findings(entry.declared_in or entry.module), Connections()
        outcome = findings.look(lambda: self._check(findings, context))
        if watched.hosts:
            findings.wrong.append(
                f"connects to {watched.hosts[0]}: fetch what it needs beforehand, keep it beside the file "
                "and name it in files="
            )
        return outcome

    def _check(self, findings: Findings, context: Context) -> None:
        scene, entry = self.scene(context), self.cell.entry
        before = fingerprints(scene)
        method = self._made(findings, context, scene)
        with findings.call("run()", self._hint(scene)):
            if self.cell.timed:
                trajectory, reading, _ = self.timed(method, LEAST_MEASURED)
            else:
                trajectory, reading = method.run(), Reading((float("nan"),))
        if reading.complaint:
            findings.wrong.append(f"{UNBELIEVABLE}{reading.complaint}")
        elif _shapes(findings, trajectory, scene, other_mesh=entry.other_mesh):
            if not entry.other_mesh:
                self._places(findings, trajectory, scene)
            self._numbers(findings, trajectory, reading, scene)
            self._again(findings, trajectory, context, scene)
        self._besides(findings, method, scene)
        changed = altered(before, scene)
        findings.demand(not changed, f"alters the scene: {changed}: copy what you change, others read it too")

    def _made(
        self, findings: Findings, context: Context, scene: BuiltScene, seed: int | None = None
    ) -> Method:
        """Make and prepare a method."""
        cell = self.cell
        with findings.call("make()", ": it is called as make(*, models, seed, **options of the entry)"):
            models = context.folder.models_of(cell.scene.garment)
            method = cell.entry.make(models=models, seed=cell.seed if seed is None else seed)
        missing = [name for name in ("prepare", "run", "inputs", "quasi_static") if not hasattr(method, name)]
        if missing:
            kind = type(method).__name__
            raise Broken(f"make() gives a {kind} without {', '.join(missing)}: derive it from Method")
        with findings.call("prepare()", self._hint(scene)):
            method.prepare(scene)
        return method

    def _hint(self, scene: BuiltScene) -> str:
        if scene.dressed is None and not self.cell.entry.needs_body:
            further = ", needs_no_obstacle=True if it knows no contact" if scene.obstacle else ""
            return f": say needs_body=True if it works on dressed bodies alone{further}"
        return ""

    def _places(self, findings: Findings, trajectory: Trajectory, scene: BuiltScene) -> None:
        """Demand that start and handles are where the scene has them."""
        import numpy as np

        x, entry = np.asarray(trajectory.positions, dtype=np.float64), self.cell.entry
        near = PLACE_TOLERANCE * max(1.0, float(np.abs(x).max(initial=0.0)))
        if not entry.gives_first_frame:
            off = float(np.abs(x[0] - scene.start).max())
            findings.demand(
                off <= near,
                f"frame 0 is {off:.3g} m off the scene's start: put scene.start there, or say "
                "gives_first_frame=True",
            )
        if scene.dressed is None and len(scene.cloth.pins) and len(x) == scene.frames:
            moves = scene.pin_positions
            for frame in range(1, len(x)):
                place = scene.start[scene.cloth.pins] if moves is None else moves(frame)
                off = float(np.abs(x[frame][scene.cloth.pins] - place).max())
                if not findings.demand(
                    off <= near,
                    f"a pin is {off:.3g} m off its place in frame {frame}: x[cloth.pins] = "
                    "scene.pin_positions(frame), or the start where that is None",
                ):
                    break

    def _numbers(
        self, findings: Findings, trajectory: Trajectory, reading: Reading, scene: BuiltScene
    ) -> None:
        """Demand a known status, finite numbers and frame times that fit the clock."""
        import numpy as np

        entry = self.cell.entry
        status, reason = judge(
            trajectory, reading, scene, truncated=entry.truncated, other_mesh=entry.other_mesh
        )
        if status == "failed" or (status != "ok" and not trajectory.reason):
            ending = f"ends as {status}: {reason or 'without a reason'}"
            findings.wrong.append(
                f"{ending}: give Trajectory a known status, and a reason where that is not ok"
            )
        elif status != "ok":
            findings.notes.append(f"ends as {status}: {reason}")
        stated = float(np.nansum(trajectory.frame_seconds))
        if self.cell.timed and stated > CLOCK_SLACK * max(reading.runs) + PLACE_TOLERANCE:
            findings.wrong.append(
                f"its frames say {stated:.3g} s in all, the clock {max(reading.runs):.3g} s: give "
                "frame_seconds in seconds, of run() alone"
            )

    def _again(self, findings: Findings, first: Trajectory, context: Context, scene: BuiltScene) -> None:
        """Demand the same positions of a second method, and of another seed unless seeds are declared."""
        import numpy as np

        def differs(seed: int | None) -> float:
            with findings.call(
                "run() of a second object", ": keep nothing between objects, in the module or on disk"
            ):
                other = np.asarray(
                    self._made(findings, context, scene, seed).run().positions, dtype=np.float64
                )
            mine = np.asarray(first.positions, dtype=np.float64)
            return (
                float(np.nanmax(np.abs(other - mine), initial=0.0)) if other.shape == mine.shape else np.inf
            )

        off = differs(None)
        same = findings.demand(
            off == 0.0,
            f"a second run gives other positions, by {off:.3g} m: draw all that is random from `seed`",
        )
        if same and not self.cell.entry.seeded and self.cell.entry.trained is None:
            off = differs(self.cell.seed + 1)
            findings.demand(
                off == 0.0, f"another seed gives other positions, by {off:.3g} m: say seeded=True"
            )

    def _besides(self, findings: Findings, method: Method, scene: BuiltScene) -> None:
        """Call what the harness asks besides run()."""
        import numpy as np

        with findings.call("inputs()"):
            make = method.inputs(scene)
            if make is not None and scene.dressed is not None:
                make(0)
        if self.cell.scene.dynamic or scene.dressed is None:  # where a cell asks for it
            with findings.call("quasi_static()", ": return None where there is no such answer"):
                held = method.quasi_static()
            if held is not None:
                _shapes(findings, held, scene, "quasi_static(): ", other_mesh=self.cell.entry.other_mesh)
        if not self.cell.entry.batched:
            return
        with findings.call("batch()"):
            positions, reading = clocked(method.batch(COPIES), of=lambda made: made, least=LEAST_MEASURED)
        if reading.complaint:
            findings.wrong.append(f"batch(): {UNBELIEVABLE}{reading.complaint}")
        shape = (scene.frames, COPIES, scene.cloth.vertex_count, 3)
        findings.demand(
            np.shape(positions) == shape, f"batch({COPIES}) gives {np.shape(positions)}, expected {shape}"
        )


def _shapes(
    findings: Findings, trajectory: object, scene: BuiltScene, what: str = "", *, other_mesh: bool
) -> bool:
    """Return whether positions, faces and times have the shapes of the scene.

    other_mesh: whether there may be other vertices and faces.
    """
    import numpy as np

    from reference_sim import Trajectory

    if not isinstance(trajectory, Trajectory):
        kind = type(trajectory).__name__
        findings.wrong.append(f"{what}gives a {kind}: return a reference_sim.Trajectory")
        return False
    x, wrong = np.asarray(trajectory.positions), misshapen(trajectory.positions, scene, other_mesh=other_mesh)
    fine = findings.demand(not wrong, f"{what}{wrong}")
    ended = trajectory.status in ("diverged", "timeout", "stalled")
    fine = fine and findings.demand(
        len(x) == scene.frames or (ended and len(x) > 0),
        f"{what}gives {len(x)} frames and ends as {trajectory.status}: {scene.frames} are due, or a status "
        "that says why it ended",
    )
    faces = np.asarray(trajectory.faces)
    findings.demand(
        other_mesh or np.array_equal(faces, scene.cloth.faces),
        f"{what}gives other faces than the scene's: give cloth.faces",
    )
    if fine:
        times = np.arange(len(x)) * scene.dt
        findings.demand(
            np.shape(trajectory.times) == (len(x),) and bool(np.allclose(trajectory.times, times)),
            f"{what}gives other times than np.arange(frames) * scene.dt",
        )
        findings.demand(
            np.shape(trajectory.frame_seconds) == (len(x),),
            f"{what}gives frame_seconds {np.shape(trajectory.frame_seconds)}: one number a frame is due",
        )
        bad = np.flatnonzero(~np.isfinite(x).all(axis=(1, 2)))
        if len(bad) and findings.demand(
            trajectory.status == "diverged" and bool(trajectory.reason),
            f"{what}has a position that is not finite in frame {bad[0]}: say status='diverged', and why",
        ):
            findings.notes.append(f"{what}ends as diverged: {trajectory.reason}")
        return not len(bad)
    return False
