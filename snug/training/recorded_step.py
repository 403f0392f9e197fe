"""A step on the energies, recorded on a GPU as CUDA graphs and played back with other windows.

A step is some hundreds of operations of a few microseconds each, and Python takes longer to ask for them than
a GPU to carry them out. So what does not depend on any number that Python has to see is recorded: from the
windows to gradients and the places of contact anchors, and then the update. Between the two the guard looks
at the energies. A batch that it would not simply follow is left to the step in single operations, which
decides what becomes of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

if TYPE_CHECKING:
    from snug.training.contact.planes import Posed
    from snug.training.optimisation_step import Trainer

WARM_UP = 3  # calls before a recording: libraries make their plans and workspaces in the first ones


class Recorded:
    """A function of tensors on a device, recorded at its first call and played back by later ones.

    On a CPU it is called each time. On a GPU every call overwrites what the one before has returned.

    Args:
        function: takes tensors of the same sizes in every call, and waits for nothing.
        device: where it runs.
        warm_up: calls before the recording; 0 for a function that must not run more often than it is called.
    """

    def __init__(self, function: Callable[..., Any], device: torch.device, *, warm_up: int = WARM_UP) -> None:
        self.function, self.device, self.warm_up = function, device, warm_up
        self._graph: torch.cuda.CUDAGraph | None = None
        self._inputs: tuple[Tensor, ...] = ()
        self._outputs: Any = None

    def __call__(self, *inputs: Tensor) -> Any:
        """Return what the function returns for these inputs."""
        if self.device.type != "cuda":
            return self.function(*inputs)
        if self._graph is None:
            self._record(inputs)
        assert self._graph is not None
        for held, given in zip(self._inputs, inputs):
            held.copy_(given, non_blocking=True)
        self._graph.replay()
        return self._outputs

    def _record(self, inputs: tuple[Tensor, ...]) -> None:
        self._inputs = tuple(given.to(self.device, copy=True) for given in inputs)
        side, here = torch.cuda.Stream(self.device), torch.cuda.current_stream(self.device)
        side.wait_stream(here)
        with torch.cuda.stream(side):
            for _ in range(self.warm_up):
                self.function(*self._inputs)
        here.wait_stream(side)
        self._graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self._graph, capture_error_mode="thread_local"):
            self._outputs = self.function(*self._inputs)


class RecordedStep:
    """The two recordings of a trainer's step: `gradients` of a batch, and `follow` them."""

    def __init__(self, trainer: Trainer) -> None:
        self.trainer, device = trainer, trainer.device
        self._descent = Recorded(self._differentiated, device)
        self._update = Recorded(self._followed, device, warm_up=0)
        self._held: dict[str, Any] = {}

    @staticmethod
    def serves(trainer: Trainer) -> bool:
        """Return whether a trainer's step can be recorded: one process, energies alone, no lead."""
        return bool(
            trainer.loss
            and not trainer.kernels
            and trainer.group.size == 1
            and trainer.past is None
            and not trainer.network.lead
            and trainer.data.shapes is None
        )

    def gradients(
        self, frames: np.ndarray, betas: np.ndarray | None, state: Tensor | None
    ) -> tuple[dict[str, np.ndarray], float]:
        """Return the terms (N, T) [J] of windows with frames (N, T), and the norm of the loss's gradient.

        betas: (N, S) shape numbers, None on the mean body; state: before the windows, None without one.
        """
        _, first, again = np.unique(frames, return_index=True, return_inverse=True)
        given = {"rows": torch.as_tensor(frames), "first": torch.as_tensor(first[again].ravel())}
        if betas is not None:
            given["betas"] = torch.as_tensor(betas)
        if state is not None:
            given["state"] = state
        self._names = tuple(given)
        self._held = self._descent(*given.values())
        numbers = self._held["numbers"].cpu().numpy()
        terms = numbers[:-1].reshape(self._held["shape"])
        return dict(zip(self._held["terms"], terms.swapaxes(0, 1))), float(numbers[-1])

    def follow(self) -> tuple[Tensor, Tensor | None, Posed | None]:
        """Update weights and anchors; return vertices, the state after them, and the bodies."""
        self._update()
        return self._held["x"], self._held["after"], self._held["posed"]

    def _differentiated(self, *inputs: Tensor) -> dict[str, Any]:
        """Return a step's tensors from its windows on, the gradients in their places."""
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

    def _followed(self) -> None:
        trainer, held = self.trainer, self._held
        taught = [p for p in trainer.network.parameters() if p.grad is not None]
        for parameter, gradient in zip(taught, held["gradients"]):  # a step in single operations has its own
            parameter.grad = gradient
        trainer.optimiser.step()
        if trainer.contact:
            trainer.contact.place(held["rows"].flatten(), held["anchors"])
