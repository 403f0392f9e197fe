"""Microbenchmark training_step/*: one training step and its parts, by network and size of the garment.

The data is the whole of what a training sees, augmented motions included. The supervised network learns
from skinned vertices here instead of simulated ones: its step takes as long.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import torch

from benchmarks.performance.learning import dressed_body, training_motions
from benchmarks.performance.microbenchmark import Settings
from benchmarks.presets import find_preset
from snug.training.device import find_device
from snug.training.optimisation_step import Trainer

WARM_UP, BLOCK = 20, 20  # steps before the clock starts, and of each block that is timed
PAPER_STEPS = find_preset("paper").steps_of("snug", "snug")


def measure(settings: Settings, *, vertices: int) -> dict[str, float]:
    """Return median and least time of a step over blocks, and the medians of its parts."""
    chosen, device = settings.training, find_device(settings.device)
    assert chosen is not None
    dressed, motions = dressed_body(vertices), training_motions()
    targets = {motion.name: dressed.skinned(motion) for motion in motions} if chosen.simulated else None
    steps = WARM_UP + BLOCK * settings.repeats
    clock = time.perf_counter()
    trainer = Trainer(
        chosen.kind, dressed, motions, steps=steps, seed=0, recipe=chosen.recipe, trajectories=targets,
        device=device,
    )  # fmt: skip
    setup = time.perf_counter() - clock
    used = time.process_time()
    blocks, parts = _timed(trainer, settings.repeats)
    used = (time.process_time() - used) / steps
    step = float(np.median(blocks))
    numbers = {
        "vertices": dressed.vertices,
        "training_frames": trainer.data.frames,
        "step_frames": trainer.windows * trainer.data.window,
        "setup": setup,
        "training_step": 1e3 * step,
        "training_step_least": 1e3 * min(blocks),
        "training_step_processor": 1e3 * used,
        **{f"training_step/{part}": 1e3 * float(np.median(taken)) for part, taken in parts.items()},
        "paper_training": PAPER_STEPS * step / 3600,
    }
    if device.type == "cuda":
        numbers["device_memory"] = torch.cuda.max_memory_allocated(device) / 1e6
    return numbers


def _timed(trainer: Trainer, blocks: int) -> tuple[list[float], dict[str, list[float]]]:
    """Return mean seconds a step of each block, whole and by part."""
    numbers = itertools.count()

    def steps(count: int) -> float:
        clock = time.perf_counter()
        for number in itertools.islice(numbers, count):
            trainer.step(number)
        if trainer.device.type == "cuda":
            torch.cuda.synchronize(trainer.device)
        return (time.perf_counter() - clock) / count

    steps(WARM_UP)
    trainer.clock.taken()
    seconds: list[float] = []
    parts: dict[str, list[float]] = {}
    for _ in range(blocks):
        seconds.append(steps(BLOCK))
        for part, taken in trainer.clock.taken().items():
            parts.setdefault(part, []).append(taken)
    return seconds, parts
