"""A step on the energies, captured on a GPU as CUDA graphs and replayed with other windows.

A step is some hundreds of operations of a few microseconds each, and Python takes longer to ask for them
than a GPU to carry them out. So what does not depend on any number that Python has to see is captured:
from the windows to gradients and the places of contact anchors, and then the update. Between the two the
guard looks at the energies. A batch that it would not simply follow is left to the step in single
operations, which decides what becomes of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from snug.training.contact_cache_torch import TensorContactCache, first_places
from snug.training.device import CudaGraph
from snug.training.divergence_guard import SETTLING
from snug.training.optimisation_step import Trainer

UNCAPTURED = 3  # first steps, which compile and make Adam's moments


class CapturedTrainer(Trainer):
    """A trainer with two graphs: from the windows to gradients, and the update by these.

    Where a step cannot be captured it takes every step in single operations: the step must be on the
    energies alone, the network read no frames before its windows, no motion have a body of its own, and
    contact have anchors, for a search for nearest vertices is on the CPU.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.capturable = bool(
            self.loss
            and not self.targets
            and not (self.kernels or self.nearest or self.network.lead)
            and self.data.shapes is None
        )
        self.captured_steps = self._asked = 0
        self._descent = CudaGraph(self._differentiate, self.device)
        self._following = CudaGraph(self._follow, self.device, warm_up=0)
        self._names: tuple[str, ...] = ()
        self._held: dict[str, Any] = {}

    def learn(
        self, number: int, windows: np.ndarray, betas: np.ndarray | None, state: Tensor | None
    ) -> dict[str, float]:
        """Replay the step; Trainer.learn takes the first ones, and those that the guard would not follow."""
        means: dict[str, float] = {}
        self._asked += 1
        if self.capturable and self._asked > UNCAPTURED and self.optimiser.state:
            means = self._replay(number, windows, betas, state)
        self.captured_steps += bool(means)
        return means or super().learn(number, windows, betas, state)

    def _replay(
        self, number: int, windows: np.ndarray, betas: np.ndarray | None, state: Tensor | None
    ) -> dict[str, float]:
        """Return the means of the terms [J a frame]; empty where the guard would not simply update."""
        frames = self.data.frames_of(windows)
        terms, norm = self._gradients(frames, betas, state)
        joules = np.sum(list(terms.values()), axis=0).mean(1)
        # Looked at before the guard judges, for it counts each batch that it judges.
        high = number >= SETTLING and (joules > self.recipe.spike).any()
        if high or not np.isfinite([*joules, norm]).all():
            return {}
        verdict = self.guard.judge(number, joules, self.namer(windows))
        accepted = self.guard.accepts(verdict, norm)
        assert verdict == "update" and accepted
        self._following()
        end, posed = self._held["end"], self._held["posed"]
        if self.hidden_states and end is not None:
            self.hidden_states.keep(frames[:, -1], end)
        if self.contact:
            self.contact.settle(frames, trusted=True)
            self.contact.requery(frames, posed, self._held["x"])
        return {name: float(energy.mean()) for name, energy in terms.items()}

    def _gradients(
        self, frames: np.ndarray, betas: np.ndarray | None, state: Tensor | None
    ) -> tuple[dict[str, np.ndarray], float]:
        """Return the terms (N, T) [J] of the windows, and the gradient norm; gradients are then in place."""
        inputs = {"rows": torch.as_tensor(frames), "first": torch.as_tensor(first_places(frames.ravel()))}
        if betas is not None:
            inputs["betas"] = torch.as_tensor(betas)
        if state is not None:
            inputs["state"] = state
        self._names = tuple(inputs)
        self._held = self._descent(*inputs.values())
        numbers = self._held["numbers"].cpu().numpy()
        terms = numbers[:-1].reshape(self._held["shape"])
        return dict(zip(self._held["terms"], terms.swapaxes(0, 1))), float(numbers[-1])

    def _differentiate(self, *inputs: Tensor) -> dict[str, Any]:
        """Run forward and backward; return what the rest of the step reads. inputs: see `_gradients`."""
        named = dict(zip(self._names, inputs))
        assert self.loss is not None
        rows = named["rows"].to(self.device)
        self.optimiser.zero_grad(set_to_none=True)
        batch = self.data.gather(rows, named.get("betas"))
        offsets, end = self.network(batch.features, named.get("state"))
        x = self.posed_by(offsets + batch.rest, self.weights, batch.transforms)
        planes = posed = anchors = None
        if self.contact:
            posed = self.contact.bodies.pose(batch)
            anchors = self.contact.walk(rows.flatten(), named["first"], posed, x)
            assert isinstance(self.contact.cache, TensorContactCache)
            at = self.contact.cache.planes_at(*anchors, *posed[1:])
            planes = at[0].unflatten(0, rows.shape), at[1].unflatten(0, rows.shape)
        terms = self.loss(x, batch.lead, planes, lag=batch.lag)
        stacked = torch.stack(list(terms.values()), 1)  # (N, terms, T)
        stacked.sum(1).mean().backward()
        gradients = [p.grad for p in self.network.parameters() if p.grad is not None]
        norm = nn.utils.get_total_norm(gradients)
        return {
            "numbers": torch.cat([stacked.detach().flatten(), norm.flatten()]), "shape": stacked.shape,
            "terms": tuple(terms), "x": x.detach(), "end": None if end is None else end.detach(),
            "posed": posed, "anchors": anchors, "rows": rows, "gradients": gradients,
        }  # fmt: skip

    def _follow(self) -> None:
        """Follow the gradients, and keep the places of the anchors."""
        tensors = self._held
        taught = [p for p in self.network.parameters() if p.grad is not None]
        # A step in single operations has its own.
        for parameter, gradient in zip(taught, tensors["gradients"]):
            parameter.grad = gradient
        on_gpu = self.device.type == "cuda"
        for group in self.optimiser.param_groups:
            group["capturable"] = on_gpu
        self.optimiser.step()
        for group in self.optimiser.param_groups:
            group["capturable"] = False  # else torch warns of every step in single operations
        if self.contact:
            assert isinstance(self.contact.cache, TensorContactCache)
            self.contact.cache.place(tensors["rows"].flatten(), tensors["anchors"])
