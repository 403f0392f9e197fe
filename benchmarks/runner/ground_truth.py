"""Simulations beside the cells: settled garments, motions to learn from, and quasi-static solutions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.method import MethodEntry
from benchmarks.plan.cell import TaskId, flat
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cells import build_scene
from benchmarks.runner.task import Context, Outcome, Task
from benchmarks.scene import BuiltScene, Scene
from reference_sim.files.atomic_files import replacing

if TYPE_CHECKING:
    import numpy as np

    from reference_sim import Trajectory
    from snug.motion.motion import Motion

# With this time step [s] and no velocities inertia weighs a thousandth of what it weighs in a frame: a hem
# that swings once in a second comes within 3 % of its static place, and there is still one minimum to go to.
SLOW = 1.0
TOLERANCE = 1e-4  # mean vertex weights: the hem is measured in millimetres


@dataclass(frozen=True, kw_only=True, eq=False)
class _OfScene(Task):
    """Base of a task that simulates once for each scene."""

    silent = True
    unit_seconds = 0.07
    scene: Scene

    @classmethod
    def id_of(cls, scene: Scene) -> TaskId:
        """Return the id of the task of a scene."""
        return cls.kind, flat(scene.name)


@dataclass(frozen=True, kw_only=True, eq=False)
class SettleStart(_OfScene):
    """The garment settled in the first pose of a scene, or what settled in its `start_of`; the posed body."""

    kind = "start"
    stage = "ground truth"

    def clear(self, folder: RunFolder) -> None:
        """Remove the files of an earlier run of it."""
        for path in self._paths(folder):
            path.unlink(missing_ok=True)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Write the settled start, the posed body and the areas at rest."""
        from reference_sim.files.array_file import read_array, write_array

        scene, run, shared = self.scene.build(context.assets), context.folder, self.scene.start_of
        assert scene.obstacle is not None
        with replacing(run.body_path(scene.name)) as temporary:
            write_array(temporary, scene.obstacle.positions)
        write_body(run, scene)
        with replacing(run.start_path(scene.name)) as temporary:
            write_array(temporary, read_array(run.start_path(shared)) if shared else scene.start_state)
        with replacing(run.rest_areas_path(scene.name)) as temporary:
            write_array(temporary, scene.cloth.areas)
        context.tell(self.units)
        return Outcome(files=tuple(map(run.relative, self._paths(run))))

    def _paths(self, folder: RunFolder) -> tuple[Path, ...]:
        name = self.scene.name
        return (
            folder.start_path(name), folder.body_path(name), folder.trajectory_path(name, "body"),
            folder.rest_areas_path(name),
        )  # fmt: skip


def write_body(run: RunFolder, scene: BuiltScene) -> None:
    """trajectories/<scene>/body.vtkhdf, to look at the garments upon."""
    import numpy as np

    from reference_sim import Trajectory

    assert scene.obstacle is not None
    Trajectory(
        positions=scene.obstacle.positions.astype(np.float32),  # for the eye: half the size
        faces=scene.obstacle.faces,
        times=np.arange(scene.frames) * scene.dt,
        provenance={"what": "the body of this scene"},
    ).save(run.trajectory_path(scene.name, "body"))


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulateMotion(Task):
    """The simulation of a training motion, settling included; networks learn from a whole one.

    entry: the method that simulates.
    """

    kind = "data"
    silent = True
    stage = "ground truth"
    unit_seconds = 0.07
    scene: Scene
    entry: MethodEntry

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Simulate the motion and write its trajectory."""
        scene = self.scene.build(context.assets)
        trajectory = simulated(scene, self.entry, context.folder)
        path = context.folder.trajectory_path(scene.name, self.entry.name)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Without what the clock showed: the same simulation has the same bytes wherever it is done.
        replace(trajectory, frame_seconds=trajectory.frame_seconds[:0]).save(path)
        context.tell(self.units)
        result = {
            "frames": trajectory.frames,
            "whole": trajectory.frames == scene.frames,
            "status": trajectory.status,
            "reason": trajectory.reason,
            "converged": trajectory.status == "converged",
        }
        return Outcome(result=result, files=(context.folder.relative(path),))


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulateClips(Task):
    """Simulations of some of a garment's augmented clips, each settled and simulated like a motion.

    Only clips that are whole and converged are kept.

    Attributes:
        scene: that of any motion in the garment.
        entry: method that simulates.
        motions: the training motions that the clips are mixed from.
        clips: name of all of them.
        part: number of these: those that `part` + 1 augmented frames for each original one have, and `part`
            have not.
        swinging: see benchmarks.training.Simulated.
    """

    kind = "clips"
    silent = True
    stage = "ground truth"
    unit_seconds = 0.07
    scene: Scene
    entry: MethodEntry
    motions: tuple[str, ...]
    clips: str
    part: int
    swinging: bool = False

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Simulate the clips and write the vertices of those that are whole and converged."""
        import numpy as np

        from snug.training.augmentation import make_shared_clips

        assets, run, garment = context.assets, context.folder, self.scene.garment
        assert assets is not None
        kept: dict[str, Any] = {}
        left_out: dict[str, str] = {}
        vertices = len(assets.garments[garment].rest_positions)
        before, clips = (
            make_shared_clips(assets.named(self.motions), share, vertices=vertices, swinging=self.swinging)
            for share in (self.part, self.part + 1)
        )
        new = clips[len(before) :]
        for clip in new:
            positions, reason = self._simulated(clip, context)
            if reason:
                left_out[clip.name] = reason
            else:
                kept[clip.name] = positions.astype(np.float32)  # as networks see it
            context.tell(self.units / len(new))
        path = run.clips_path(self.clips, self.entry.name, self.part)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            np.savez(temporary, **kept)
        result = {"clips": list(kept), "left_out": left_out}
        return Outcome(result=result, files=(run.relative(path),))

    def _simulated(self, clip: Motion, context: Context) -> tuple[np.ndarray, str]:
        """Return positions (T,V,3) [m] of a clip, and why no network learns from them, or empty."""
        import numpy as np

        assets, garment = context.assets, self.scene.garment
        assert assets is not None
        alone = replace(assets, motions={clip.name: clip}, clips={}, bodies={})
        scene = replace(self.scene, name=f"{garment}/{clip.name}", motion=clip.name).build(alone)
        try:
            trajectory = simulated(scene, self.entry, context.folder)
        except RuntimeError as error:  # a pose that leaves the cloth no room
            return np.empty(0), str(error) or type(error).__name__
        done = trajectory.status == "converged" or self.entry.truncated
        whole = trajectory.frames == clip.frames and np.isfinite(trajectory.positions).all()
        return trajectory.positions, "" if done and whole else f"{trajectory.status}: {trajectory.reason}"


def simulated(scene: BuiltScene, entry: MethodEntry, folder: RunFolder) -> Trajectory:
    """Return the trajectory of a scene by a method that needs no network."""
    method = entry.make(models=folder.models, seed=0)
    method.prepare(replace(scene, dressed=None))  # so that it shows no bar beside that of all tasks
    return method.run()


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulateQuasiStatic(_OfScene):
    """Quasi-static solution of each frame of a scene: dynamics are measured against it."""

    kind = "quasi-static"
    stage = "quasi-static answers"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Simulate each frame held still and write the trajectory."""
        import numpy as np

        from reference_sim import simulate

        scene = build_scene(self.scene, context)
        path = context.folder.quasi_static_path(scene.name)
        path.parent.mkdir(parents=True, exist_ok=True)
        trajectory = simulate(
            scene.cloth, scene.simulated_energies, dt=SLOW, frames=scene.frames, obstacle=scene.obstacle,
            start=scene.start, quasi_static=True, tolerance=TOLERANCE, pin_positions=scene.pin_positions,
        )  # fmt: skip
        context.tell(self.units)
        if trajectory.frames < scene.frames or not np.isfinite(trajectory.positions).all():
            reason = f"ended after {trajectory.frames} of {scene.frames} frames: {trajectory.reason}"
            return Outcome("diverged", reason, failed=True)
        trajectory.save(path)
        left = int((trajectory.frame_fields["converged"] == 0.0).sum())
        result = {"status": trajectory.status, "frames_not_converged": left}
        return Outcome(result=result, files=(context.folder.relative(path),))
