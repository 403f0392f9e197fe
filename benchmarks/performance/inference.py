"""Microbenchmark inference/*: a frame at a time on one CPU core, network and skinning; size of a network.

Weights are random: neither time nor size depends on them. The supervised network is SNUG's.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.performance.learning import dressed_body, training_motions
from benchmarks.performance.microbenchmark import Settings
from snug.networks.roll_out import prepare_frames
from snug.training.train_network import untrained_model

if TYPE_CHECKING:
    from snug.motion.motion import Motion
    from snug.networks.dressed_body import DressedBody
    from snug.networks.trained_model import TrainedModel


SWEPT = 48  # [MB] of other work between two cold frames: a solver, and what lies in the caches of a large CPU


def measure(settings: Settings, *, vertices: int) -> dict[str, float]:
    """Return median, 95 % and least time of frames, the median of a cold one, and sizes of the network."""
    chosen = settings.training
    assert chosen is not None
    dressed, motions = dressed_body(vertices), training_motions()
    model = untrained_model(chosen.kind, dressed, motions, seed=0, recipe=chosen.recipe)
    frame_seconds(model, dressed, motions[0])
    runs = [frame_seconds(model, dressed, motions[0]) for _ in range(settings.repeats)]
    frames = 1e3 * np.concatenate(runs)
    with tempfile.TemporaryDirectory() as folder:
        size = model.save(Path(folder) / "model.safetensors").stat().st_size
    return {
        "vertices": dressed.vertices,
        "timed_frames": len(frames),
        "inference": float(np.median(frames)),
        "inference_p95": float(np.quantile(frames, 0.95)),
        "inference_least": float(frames.min()),
        "inference_cold": 1e3 * float(np.median(frame_seconds(model, dressed, motions[0], swept=SWEPT))),
        "parameters": sum(p.numel() for p in model.network.parameters()),
        "network_memory": model.megabytes,
        "model_file": size / 1e6,
    }


def frame_seconds(
    model: TrainedModel, dressed: DressedBody, motion: Motion, *, swept: int = 0
) -> list[float]:
    """Return wall times [s] of each frame of a roll-out; inputs and joint transforms are ready before.

    swept: [MB] read and written before each frame, off the clock.
    """
    other = np.zeros(swept * 125_000)
    frames, seconds = prepare_frames(model, dressed, motion)(), []
    for _ in range(motion.frames):
        other += 1.0
        start = time.perf_counter()
        next(frames)
        seconds.append(time.perf_counter() - start)
    return seconds
