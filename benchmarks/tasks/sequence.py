"""A sequence of a data set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from benchmarks.cell import TaskId
from benchmarks.tasks.ground_truth import SimulateMotion
from benchmarks.tasks.task import Context, Outcome


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulateSequence(SimulateMotion):
    """The simulation of a motion; beside it the motion itself and the vertices that networks learn from."""

    kind = "sequence"
    stage = "sequences"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Simulate the motion and write what networks learn from beside it."""
        from reference_sim.trajectory import Trajectory
        from snug.training.simulated_data import write_motion, write_vertices

        outcome, folder, assets = super().run(context, needed), context.folder, context.assets
        assert assets is not None
        trajectory, motion = folder.path / outcome.files[0], assets.motions[self.scene.motion]
        beside = trajectory.with_name("motion.npz"), trajectory.with_name("vertices.npy")
        write_motion(beside[0], motion)
        write_vertices(beside[1], Trajectory.load(trajectory).positions, motion, assets.body)
        return replace(outcome, files=(*outcome.files, *map(folder.relative, beside)))
