"""One training step: its time and what of, by network and size of the garment.

The data is the whole of what a training sees, mixed motions included. The supervised network is taught by
skinned vertices here instead of simulated ones: its step takes as long.
"""

from __future__ import annotations

import itertools
import time
from typing import TYPE_CHECKING

import numpy as np

from ..parts import Row
from ..presets import find_preset
from .settings import Settings, dressed_body, kind_and_vertices, training_motions

if TYPE_CHECKING:
    from snug.trainer import Trainer

CASES = tuple(f"{kind}, {n}" for kind in ("snug", "supervised", "pbns") for n in (500, 1000, 2000, 4400))
WARM_UP, BLOCK = 20, 20  # steps before the clock starts, and of each block that is timed
PAPER_STEPS = find_preset("paper").steps_of("snug")


def measure(case: str, settings: Settings) -> list[Row]:
    """Median and least time of a step over blocks, and the medians of its parts.

    Processor time is there to tell a machine that was busy with other things.
    """
    import torch

    from snug.device import find_device
    from snug.recipe import TRAININGS
    from snug.trainer import Trainer

    kind, vertices = kind_and_vertices(case)
    training, device = TRAININGS[kind], find_device(settings.device)
    dressed, motions = dressed_body(vertices), training_motions()
    taught = {motion.name: dressed.skinned(motion) for motion in motions} if training.simulated else None
    clock = time.perf_counter()
    trainer = Trainer(
        training.kind, dressed, motions, steps=WARM_UP + BLOCK * settings.repeats, seed=0,
        recipe=training.recipe, trajectories=taught, device=device,
    )  # fmt: skip
    ready = time.perf_counter() - clock
    used = time.process_time()
    blocks, parts = _timed(trainer, settings.repeats)
    used = (time.process_time() - used) / (WARM_UP + BLOCK * settings.repeats)
    step = float(np.median(blocks))
    rows: list[Row] = [
        ("vertices", dressed.vertices, ""),
        ("frames to learn from", trainer.data.frames, ""),
        ("frames of a step", trainer.windows * trainer.data.window, ""),
        ("made ready in", ready, "s"),
        ("step, median", 1e3 * step, "ms"),
        ("step, least", 1e3 * min(blocks), "ms"),
        ("step, processor time, first ones included", 1e3 * used, "ms"),
        *((f"step: {part}", 1e3 * float(np.median(taken)), "ms") for part, taken in parts.items()),
        (f"{PAPER_STEPS} steps at the median", PAPER_STEPS * step / 3600, "h"),
    ]
    if device.type == "cuda":
        rows.append(("peak memory of the device", torch.cuda.max_memory_allocated(device) / 1e6, "MB"))
    return rows


def _timed(trainer: Trainer, blocks: int) -> tuple[list[float], dict[str, list[float]]]:
    """Mean seconds a step of each block, whole and by part."""
    import torch

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
