"""A trained network from a file, in the place of its training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks import provenance
from benchmarks.cell import TaskId
from benchmarks.results.run_folder import RunFolder
from benchmarks.tasks.task import Context, Outcome, Task
from benchmarks.tasks.training import TrainNetwork, facts_of


@dataclass(frozen=True, kw_only=True, eq=False)
class TakeNetwork(Task):
    """Copy of a trained network into the run's folder, under the name that its training gives it.

    instead_of: that training. source: the file; None without one. refusal: why the file is not taken, or why
    there is none. differing: names of what a training here depends on and that the file was trained with in
    another version; none where a training here gives the same bits.
    """

    kind = "network"
    silent = True
    stage = "pretrained networks"
    instead_of: TrainNetwork
    source: Path | None = None
    refusal: str = ""
    differing: tuple[str, ...] = ()

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        """Return why the network is not taken, or empty."""
        return self.refusal

    def clear(self, folder: RunFolder) -> None:
        """Remove the model of an earlier training."""
        self.instead_of.clear(folder)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Copy the file, once it is known to be whole. The outcome names the machine that trained it."""
        from snug.networks.trained_model import TrainedModel

        assert self.source is not None
        model, path = TrainedModel.load(self.source), self.instead_of.path(context.folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        model.save(path)
        facts = {
            "pretrained": self.source.stem,
            "trained_at": model.origin["commit"],
            "differing": list(self.differing),
            "data_seconds": model.origin["data_seconds"],
        }
        return Outcome(
            result=facts_of(model) | facts,
            files=(context.folder.relative(path),),
            origin={"hardware": provenance.hardware_line(model.origin["hardware"])},
        )
