"""Training of one network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.declarations import load
from benchmarks.fingerprint.digest import digest
from benchmarks.plan.plan import TaskId
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.tasks.task import Context, Outcome, Task

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.assets.assets import Assets
    from benchmarks.training import Training
    from snug.motion.motion import Motion
    from snug.networks.trained_model import TrainedModel

LONGEST = 4  # times the steps of others: at most as many has a training that is to converge
VALIDATIONS = 25  # in the steps of others: after so many that were no better it has converged
# Of a step, where a step of SNUG's network takes 1: the longest training begins first.
COST = {"pbns": 0.4, "ncs": 2.5, "ncs-static": 2.5, "handles-20": 0.4, "handles-40": 0.4, "handles-80": 0.5}
PREPARATION = 25.0  # [s] expected before the first step: clips are mixed, bodies posed
LOG_EVERY = 20  # training steps between two reports of progress
# Of a training's summary: what its guard against divergence has done, and its epochs.
INCIDENTS = ("high_windows", "skipped_updates", "restored", "epochs")
CHECKPOINT_MINUTES = 1.0  # between two checkpoints: what a kill loses at most


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainNetwork(Task):
    """A network, or an untrained one, in the folder of its garment's networks.

    training: its name; chosen: how it is trained, None: not at all; home: what has to be loaded before, as
    the file that declares an energy of its recipe. motions: what it learns from; held_out: motions that
    stop it, where it goes on until it has converged; simulated: motion -> the task that simulates it, where
    it learns from simulations; clips: those that simulate mixed clips. device: cpu or cuda, for every part of
    a step. parts: name -> digest or version of all that the network depends on: inputs, source files,
    packages, data, and as `simulations` the code and inputs of what simulates.
    """

    kind = "network"
    silent = True
    stage = "training"
    unit_seconds = 0.03
    training: str
    chosen: Training | None
    home: str = ""
    seed: int
    garment: str
    steps: int
    motions: tuple[str, ...]
    held_out: tuple[str, ...] = ()
    simulated: Mapping[str, TaskId]
    clips: tuple[TaskId, ...] = ()
    device: str
    parts: Mapping[str, str] = field(default_factory=dict)

    @property
    def expected_seconds(self) -> float:
        """Expected duration [s]."""
        if self.chosen is None:
            return 0.0
        return PREPARATION + super().expected_seconds * COST.get(self.chosen.kind, 1.0)

    @property
    def key(self) -> str:
        """Digest of the parts.

        With equal simulations, a training of the same key that was killed goes on from its last checkpoint,
        and ends as it would have.
        """
        return digest(dict(self.parts))

    @property
    def split_parts(self) -> dict[str, dict[str, str]]:
        """The parts as `inputs` and as `software`: source, packages and data."""
        inputs = {name: part for name, part in self.parts.items() if name in self.inputs}
        software = {name: part for name, part in self.parts.items() if name not in inputs}
        return {"inputs": inputs, "software": software}

    def path(self, folder: RunFolder) -> Path:
        """Return the path of the trained model."""
        return model_path(folder.models_of(self.garment), self.training, self.seed)

    def clear(self, folder: RunFolder) -> None:
        """Remove the model of an earlier training."""
        self.path(folder).unlink(missing_ok=True)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Train the network and write its model."""
        import torch

        from reference_sim.trajectory import Trajectory
        from snug.networks.dressed_body import DressedBody
        from snug.training.checkpoint import Checkpoint
        from snug.training.train_network import train_network, untrained_model
        from snug.training.validation import Validation

        torch.set_num_threads(1)
        if self.home:
            load(self.home)
        assets, run = context.assets, context.folder
        assert assets is not None
        path = self.path(run)
        dressed = DressedBody(assets.body, assets.garments[self.garment])
        motions, targets = self.motions, None
        mixed: list[Motion] = []
        if self.simulated:
            whole = {m: needed[id] for m, id in self.simulated.items() if self._is_whole(needed.get(id))}
            motions = tuple(motion for motion in self.motions if motion in whole)
            targets = {m: Trajectory.load(run.path / o.files[0]).positions for m, o in whole.items()}
            mixed, simulated = self._mixed(assets, run, needed)
            targets |= simulated
        validation = None
        if self.held_out:
            every = max(1, self.steps // (LONGEST * VALIDATIONS))
            held_out = assets.named(self.held_out)
            validation = Validation(motions=held_out, every=every, patience=VALIDATIONS, trajectories=targets)
        checkpoint = Checkpoint(
            path=path.with_name(f".{path.stem}.checkpoint.safetensors"), minutes=CHECKPOINT_MINUTES,
            resume=True, key=digest([self.key, targets]),
        )  # fmt: skip
        reported, preparation = 0.0, PREPARATION / max(self.expected_seconds, PREPARATION)  # steps, share

        def log(row: dict[str, float]) -> None:
            nonlocal reported
            done = self.steps * preparation + row["step"] * (1.0 - preparation)
            context.tell(done - reported)
            reported = done

        if self.chosen is None:
            model = untrained_model("snug", dressed, assets.named(motions), seed=self.seed)
        else:
            model = train_network(
                self.chosen.kind, dressed, [*assets.named(motions), *mixed], steps=self.steps,
                seed=self.seed, trajectories=targets, recipe=self.chosen.recipe, log=log, progress=False,
                every=LOG_EVERY, device=self.device, checkpoint=checkpoint, validation=validation,
            )  # fmt: skip
        if reported < self.steps:  # it ended early
            context.tell(self.steps - reported)
        model.origin = self._origin(needed, left_out=[name for name in self.motions if name not in motions])
        path.parent.mkdir(parents=True, exist_ok=True)
        model.save(path)
        checkpoint.delete()
        return Outcome(result=facts_of(model), files=(run.relative(path),))

    def _origin(self, needed: Mapping[TaskId, Outcome], *, left_out: list[str]) -> dict[str, Any]:
        """Return what the file of the model says of its training; left_out: motions without simulation."""
        simulated = self.chosen.simulated if self.chosen else None
        return {
            "network": self.training,
            "garment": self.garment,
            "motions": [name for name in self.motions if name not in left_out],
            "held_out": list(self.held_out),
            "simulated_by": simulated.method if simulated else "",
            "left_out": left_out,
            "clips_left_out": sum(len(needed[id].result["left_out"]) for id in self.clips if id in needed),
            "data_seconds": sum(needed[id].seconds for id in self.reads if id in needed),
            "commit": provenance.commit(),
            "hardware": provenance.hardware(self.device),
            "versions": provenance.versions(),
            "digest": self.key,
            **self.split_parts,
        }

    def _mixed(
        self, assets: Assets, folder: RunFolder, needed: Mapping[TaskId, Outcome]
    ) -> tuple[list[Motion], dict[str, np.ndarray]]:
        """Return the augmented clips that were simulated, and their vertices (T,V,3) [m] by name."""
        from reference_sim.files.array_file import read_arrays
        from snug.training.augmentation.mixed_clips import make_shared_clips

        vertices_of: dict[str, np.ndarray] = {}
        for id in self.clips:
            if id in needed:
                vertices_of |= read_arrays(folder.path / needed[id].files[0])
        if twice := sorted(vertices_of.keys() & set(self.motions)):
            raise ValueError(f"training motion {twice[0]!r}: a mixed clip is called so: rename its file")
        vertices = len(assets.garments[self.garment].rest_positions)
        simulated = self.chosen.simulated if self.chosen else None
        clips = make_shared_clips(
            assets.named(self.motions), len(self.clips), vertices=vertices,
            swinging=simulated is not None and simulated.swinging,
        )  # fmt: skip
        return [clip for clip in clips if clip.name in vertices_of], vertices_of

    @staticmethod
    def _is_whole(outcome: Outcome | None) -> bool:
        return outcome is not None and bool(outcome.result["whole"])


def facts_of(model: TrainedModel) -> dict[str, Any]:
    """Return the result of the task that trained a model, or took it from a file."""
    return {
        "recipe": model.recipe.name,
        "left_out": model.origin["left_out"],
        "clips_left_out": model.origin["clips_left_out"],
        "frames": model.summary.get("training_frames", 0),
        "seconds": model.seconds,
        "setup_seconds": model.setup_seconds,
        "megabytes": model.megabytes,
        "steps": model.steps,
        **{name: model.summary[name] for name in INCIDENTS if name in model.summary},
        "validation": model.summary.get("validation", {}),
        "last": dict(model.history[-1]) if model.history else {},
    }
