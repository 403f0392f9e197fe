"""A sequence of a data set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from .ground_truth import SimulateMotion
from .task import Context, Outcome, TaskId


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulateSequence(SimulateMotion):
    """The simulation of a motion, and beside it the motion itself: what networks learn from is then whole."""

    kind = "sequence"
    stage = "sequences"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        from snug.dataset import write_motion

        outcome = super().run(context, needed)
        assert context.assets is not None
        path = (context.folder.path / outcome.files[0]).with_name("motion.npz")
        write_motion(path, context.assets.motions[self.scene.motion])
        return replace(outcome, files=(*outcome.files, context.folder.relative(path)))
