"""Metrics cost/*: declared here, taken from clocks, processes and trainings by benchmarks.runner.rows."""

from __future__ import annotations

from typing import Any

from benchmarks.metric import Metric


def _cost(name: str, unit: str, title: str, definition: str, table: str = "cost") -> Metric:
    return Metric(
        name=f"cost/{name}", unit=unit, title=title, definition=definition, table=table, lower_is_better=True,
        of="machine",
    )  # fmt: skip


def _size(name: str, unit: str, title: str, definition: str, **more: Any) -> Metric:
    return Metric(
        name=f"cost/{name}", unit=unit, title=title, definition=definition, of="method", **more
    )  # fmt: skip


METRICS = (
    _cost("data", "s", "Data generation", "simulation of the training motions, settling included"),
    _cost("setup", "s", "Preprocessing", "what a training does before its first step"),
    _cost("train", "s", "Training", "wall time of the steps of the training"),
    _size("train_steps", "1", "Steps", "updates of the training"),
    _size("train_frames", "1", "Training frames", "frames that it learned from, augmented ones included"),
    _cost("frame", "ms", "Inference", "inference time: time of the whole run over the frames computed, "
          "one frame at a time on one thread; the median of repeated runs"),
    _cost("whole", "ms", "End to end", "the same and what the method takes as ready: features and joint "
          "transforms of a network, the posed body of a solver, made one frame at a time: from pose to world "
          "vertices"),
    _cost("frame_p50", "ms", "Median frame",
          "50 % of the frames take less inference time, each by its median run", ""),
    _cost("frame_p95", "ms", "Frame, p95",
          "95 % of the frames take less inference time, each by its median run"),
    _cost("frame_worst", "ms", "Slowest frame", "inference time of the slowest frame by its median run", ""),
    _cost("batch", "ms", "In batch", "time per frame and body of 16 bodies at once"),
    _cost("spread", "%", "Spread", "largest less smallest repeat, as a share of their median", ""),
    _size("memory", "MB", "Memory", "size of the network", table="cost", lower_is_better=True),
    _cost("peak", "MB", "Process", "most memory of the method's process until its run had ended"),
)  # fmt: skip
