"""A step on the energies, captured on a GPU as CUDA graphs and replayed with other windows.

A step is some hundreds of operations of a few microseconds each, and Python takes longer to ask for them than
a GPU to carry them out. So what does not depend on any number that Python has to see is captured: from the
windows to gradients and the places of contact anchors, and then the update. Between the two the guard looks
at the energies. A batch that it would not simply follow is left to the step in single operations, which
decides what becomes of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from snug.training.contact_cache_torch import first_places
from snug.training.device import CudaGraph
from snug.training.divergence_guard import SETTLING

if TYPE_CHECKING:
    from snug.training.optimisation_step import Trainer

UNCAPTURED = 3  # first steps, in single operations: they compile, and make Adam's moments


class CapturedStep:
    """The graphs of a trainer's step: from its windows to gradients, and the update by these."""

    def __init__(self, trainer: Trainer) -> None:
        self.trainer, device = trainer, trainer.device
        self._descent = CudaGraph(self._differentiated, device)
        self._update = CudaGraph(self._updated, device, warm_up=0)
        self._names: tuple[str, ...] = ()
        self._held: dict[str, Any] = {}
        self._steps = 0

    @staticmethod
    def serves(trainer: Trainer) -> bool:
        """Return whether a trainer's step can be captured.

        The step must be on the energies alone. The network must read no frames before its windows, and no
        motion may have a body of its own.
        """
        return bool(
            trainer.loss
            and not trainer.kernels
            and trainer.past is None
            and not trainer.network.lead
            and trainer.data.shapes is None
        )

    def take(
        self, number: int, windows: np.ndarray, frames: np.ndarray, betas: np.ndarray | None,
        state: Tensor | None,
    ) -> dict[str, float]:  # fmt: skip
        """Take step `number`; return the means of its terms [J a frame].

        Empty in the first steps, and where the guard would not simply update: weights, anchors and guard are
        then as they were.

        Args:
            number: of the step.
            windows: (N,), places of the batch's windows.
            frames: (N, T), their row numbers.
            betas: (N, S) shape numbers, None on the mean body.
            state: before the windows, None without one.
        """
        trainer = self.trainer
        self._steps += 1
        if self._steps <= UNCAPTURED or not trainer.optimiser.state:
            return {}
        with trainer.clock.part("captured"):
            terms, norm = self._gradients(frames, betas, state)
        joules = np.sum(list(terms.values()), axis=0).mean(1)
        # Looked at before the guard judges, for it counts each batch that it judges.
        high = number >= SETTLING and (joules > trainer.recipe.spike).any()
        if high or not np.isfinite([*joules, norm]).all():
            return {}
        name = trainer.namer(windows)
        verdict = trainer.guard.judge(number, joules, name)
        accepted = trainer.guard.accepts(number, verdict, norm, joules, name)
        assert verdict == "update" and accepted
        with trainer.clock.part("optimiser"):
            self._update()
        after, posed = self._held["after"], self._held["posed"]
        if trainer.hidden_states and after is not None:
            trainer.hidden_states.keep(frames[:, -1], after)
        if trainer.contact:
            with trainer.clock.part("requery"):
                trainer.contact.settle(frames, trusted=True)
                trainer.contact.requery(frames, posed, self._held["x"])
        return {name: float(energy.mean()) for name, energy in terms.items()}

    def _gradients(
        self, frames: np.ndarray, betas: np.ndarray | None, state: Tensor | None
    ) -> tuple[dict[str, np.ndarray], float]:
        """Return the terms (N, T) [J] of the windows, and the gradient norm; gradients are then in place."""
        given = {"rows": torch.as_tensor(frames), "first": torch.as_tensor(first_places(frames.ravel()))}
        if betas is not None:
            given["betas"] = torch.as_tensor(betas)
        if state is not None:
            given["state"] = state
        self._names = tuple(given)
        self._held = self._descent(*given.values())
        numbers = self._held["numbers"].cpu().numpy()
        terms = numbers[:-1].reshape(self._held["shape"])
        return dict(zip(self._held["terms"], terms.swapaxes(0, 1))), float(numbers[-1])

    def _differentiated(self, *inputs: Tensor) -> dict[str, Any]:
        """Run forward and backward; return what the rest of the step reads. inputs: see `_gradients`."""
        given, trainer = dict(zip(self._names, inputs)), self.trainer
        assert trainer.loss is not None
        rows = given["rows"].to(trainer.device)
        trainer.optimiser.zero_grad(set_to_none=True)
        batch = trainer.data.gathered(rows, given.get("betas"))
        offsets, after = trainer.network(batch.features, given.get("state"))
        x = trainer.posed_by(offsets + batch.rest, trainer.weights, batch.transforms)
        planes = posed = anchors = None
        if trainer.contact:
            posed, anchors, planes = trainer.contact.walked(batch, rows, given["first"], x)
        terms = trainer.loss(x, batch.ahead, planes, behind=batch.behind)
        stacked = torch.stack(list(terms.values()), 1)  # (N, terms, T)
        stacked.sum(1).mean().backward()
        gradients = [p.grad for p in trainer.network.parameters() if p.grad is not None]
        norm = nn.utils.get_total_norm(gradients)
        return {
            "numbers": torch.cat([stacked.detach().flatten(), norm.flatten()]), "shape": stacked.shape,
            "terms": tuple(terms), "x": x.detach(), "after": None if after is None else after.detach(),
            "posed": posed, "anchors": anchors, "rows": rows, "gradients": gradients,
        }  # fmt: skip

    def _updated(self) -> None:
        """Follow the gradients, and keep the places of the anchors."""
        trainer, held = self.trainer, self._held
        taught = [p for p in trainer.network.parameters() if p.grad is not None]
        for parameter, gradient in zip(taught, held["gradients"]):  # a step in single operations has its own
            parameter.grad = gradient
        on_gpu = trainer.device.type == "cuda"
        for group in trainer.optimiser.param_groups:
            group["capturable"] = on_gpu
        trainer.optimiser.step()
        for group in trainer.optimiser.param_groups:
            group["capturable"] = False  # else torch warns of every step in single operations
        if trainer.contact:
            trainer.contact.place(held["rows"].flatten(), held["anchors"])
