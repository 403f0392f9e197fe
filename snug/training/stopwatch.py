"""Seconds of each part of a training step."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import torch

# On a GPU "captured" is all from the windows to the gradients; see snug.training.captured_step.
PARTS = ("draw", "forward", "skinning", "contact", "energies", "backward", "captured", "optimiser", "requery")

WATCH_EVERY = 10  # steps, on a GPU


class Stopwatch:
    """Wall time by part of a step.

    On a GPU it must wait for the work of each part to end, so there it watches one step in WATCH_EVERY.
    """

    def __init__(self, device: torch.device) -> None:
        self._waits = device.type == "cuda"
        self.device, self._live, self.steps = device, True, 0
        self._seconds = dict.fromkeys(PARTS, 0.0)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the time of the block for the part of that name (one of PARTS)."""
        if not self._live:
            yield
            return
        start = self._now()
        yield
        self._seconds[name] += self._now() - start

    def _now(self) -> float:
        if self._waits:
            torch.cuda.current_stream(self.device).synchronize()
        return time.perf_counter()

    def step_begins(self, number: int) -> None:
        """Begin step `number`."""
        self._live = not self._waits or number % WATCH_EVERY == 0
        self.steps += self._live

    def taken(self) -> dict[str, float]:
        """Return the mean seconds a step of each part since the last call, and start anew."""
        means = {name: s / self.steps for name, s in self._seconds.items() if s and self.steps}
        self._seconds, self.steps = dict.fromkeys(PARTS, 0.0), 0
        return means
