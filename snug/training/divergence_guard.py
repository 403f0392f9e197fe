"""Guard against divergence: batches that are not finite or far too high are named, good weights come back.

Three cases, from harmless to grave:
- a window is above the recipe's `spike`: the gradient of its step is clipped;
- a window, or the gradient of a batch, is not finite: the update is left out;
- `PATIENCE` batches in a row are not finite, or their mean is above both `spike` and `RUNAWAY` times the
  size of the usual energy, which is negative where a garment hangs below the pelvis: the network is lost.
  Weights and Adam's moments go back to the last ones seen to be good, and the learning rate is halved.
A recipe with a spike beyond all energies, as the paper's, is left alone until something is not finite.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from torch import Tensor, nn, optim

from snug.training.training_set import TrainingError

NAMED_WINDOWS = 50  # incidents that are named one by one; all are counted
SETTLING = 50  # steps before which a high window is no cause for a remark
PATIENCE = 3  # bad batches in a row, after which good weights come back
GIVE_UP = 100  # updates left out in a row, after which training stops
RUNAWAY = 10.0  # times the size of the usual energy of a batch
MEMORY = 0.98  # of the usual energy, per step
SNAPSHOT_EVERY = 100  # steps between two copies of good weights
FACTS = ("rate", "summary", "usual", "good_step", "bad_in_a_row", "skipped_in_a_row")  # of a checkpoint


class DivergenceGuard:
    """A verdict on each batch before its update. spike: see Recipe [J]; None for a loss in other units."""

    def __init__(self, network: nn.Module, optimiser: optim.Optimizer, *, spike: float | None) -> None:
        self.network, self.optimiser, self.spike = network, optimiser, spike
        self.rate = 1.0  # of the learning rate, halved by each return to good weights
        self.summary: dict[str, Any] = {
            "high_windows": 0, "skipped_updates": 0, "restored": 0, "named_windows": [],
        }  # fmt: skip
        self.usual: float | None = None  # J, mean of a batch
        self.bad_in_a_row = self.skipped_in_a_row = 0
        self.good_step = -1
        self._good: dict[str, Tensor] = {}
        # Of the batch that is judged.
        self._number, self._joules = 0, np.empty(0)
        self._name: Callable[[int], str] = str

    def judge(self, number: int, joules: np.ndarray, name: Callable[[int], str]) -> str:
        """Return the verdict on a batch, before its update.

        Args:
            number: of the step.
            joules: of each window, (N,), mean a frame.
            name: gives the name of a window, by its row.

        Returns:
            `update`; `clip` the gradient; `distrust`: clip it, and learn nothing else from the
            prediction; `leave out`.

        Raises:
            TrainingError: after GIVE_UP updates left out in a row.
        """
        self._number, self._joules, self._name = number, joules, name
        bad = ~np.isfinite(joules)
        if bad.any():
            self._leave_out(np.flatnonzero(bad), "update left out")
            self._count_bad()
            return "leave out"
        spike = math.inf if self.spike is None or number < SETTLING else self.spike
        mean = float(joules.mean(dtype=np.float64))
        peaks = joules > spike
        runaway = self.usual is not None and mean > max(spike, RUNAWAY * abs(self.usual))
        if runaway and self._count_bad():
            self.summary["skipped_updates"] += 1
            return "leave out"
        if not runaway:
            self.usual = mean if self.usual is None else MEMORY * self.usual + (1 - MEMORY) * mean
        if peaks.any():
            self._remark(np.flatnonzero(peaks), "gradient clipped")
        return "distrust" if runaway else "clip" if peaks.any() else "update"

    def accepts(self, verdict: str, gradient_norm: float) -> bool:
        """Return whether the gradient of the batch, with that verdict, may be followed.

        One that is not finite would ruin the weights; the highest window is named. Raises as `judge`
        does.
        """
        if np.isfinite(gradient_norm):
            self.skipped_in_a_row = 0
            if verdict != "distrust":
                self.bad_in_a_row = 0
                if self._number - self.good_step >= SNAPSHOT_EVERY or not self._good:
                    live = live_tensors(self.network, self.optimiser)
                    self._good = {name: tensor.detach().clone() for name, tensor in live}
                    self.good_step = self._number
            return True
        self._leave_out(np.argmax(self._joules, keepdims=True), "gradient not finite, update left out")
        if verdict != "distrust":  # which has been counted
            self._count_bad()
        return False

    def _leave_out(self, rows: np.ndarray, action: str) -> None:
        self._remark(rows, action)
        self.summary["skipped_updates"] += 1
        self.skipped_in_a_row += 1
        if self.skipped_in_a_row >= GIVE_UP:
            name = self._name(int(rows[0]))
            raise TrainingError(f"training diverged: {GIVE_UP} updates in a row not finite, last {name}")

    def _count_bad(self) -> bool:
        """Count one more bad batch; return whether that brought good weights back."""
        self.bad_in_a_row += 1
        if self.bad_in_a_row < PATIENCE or not self._good:
            return False
        highest = np.argmax(np.nan_to_num(self._joules, nan=np.inf), keepdims=True)
        self._remark(highest, f"weights of step {self.good_step} restored, rate halved")
        for name, tensor in live_tensors(self.network, self.optimiser):
            if name in self._good:
                tensor.detach().copy_(self._good[name])
            else:  # a moment that the optimiser did not have yet when the copy was made
                tensor.detach().zero_()
        if self.skipped_in_a_row <= PATIENCE:  # data that is not finite would halve it again and again
            self.rate *= 0.5
        self.summary["restored"] += 1
        self.bad_in_a_row = 0
        return True

    def _remark(self, rows: np.ndarray, action: str) -> None:
        for row in rows.tolist():
            self.summary["high_windows"] += not action.startswith("weights")
            if len(self.summary["named_windows"]) < NAMED_WINDOWS:
                window, value = self._name(row), repr(float(self._joules[row]))
                named = {"step": self._number, "window": window, "joules": value, "action": action}
                self.summary["named_windows"].append(named)

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return everything that a resumed run needs: tensors and plain facts."""
        return dict(self._good), {name: getattr(self, name) for name in FACTS}

    def resume(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """Continue from a `state`."""
        device = next(self.network.parameters()).device
        self._good = {name: tensor.to(device) for name, tensor in tensors.items()}
        for name in FACTS:
            setattr(self, name, facts[name])


def live_tensors(network: nn.Module, optimiser: optim.Optimizer) -> list[tuple[str, Tensor]]:
    """Return the weights and Adam's state by name, not copied: writing into them changes the network."""
    tensors = [(f"network.{name}", tensor) for name, tensor in network.state_dict(keep_vars=True).items()]
    for name, parameter in network.named_parameters():
        tensors += [(f"adam.{name}.{key}", tensor) for key, tensor in optimiser.state[parameter].items()]
    return tensors
