"""Devices that networks train on, and what makes small operations fast on a GPU."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, ParamSpec, TypeVar

import torch
from torch import Tensor

CPU = torch.device("cpu")
P = ParamSpec("P")
R = TypeVar("R")


def find_device(name: str) -> torch.device:
    """Return the device `cpu`, `cuda` or `cuda:1`; on a GPU, recurrent units no longer use TF32.

    Raises ValueError for an unknown or absent one.
    """
    try:
        device = torch.device(name)
    except RuntimeError:
        device = None
    if device is None or device.type not in ("cpu", "cuda"):
        raise ValueError(f"--device {name}: use cpu or cuda")
    if device.type == "cpu":
        return device
    if (device.index or 0) >= torch.cuda.device_count():
        raise ValueError(
            f"--device {name}: this machine has {torch.cuda.device_count()} of them; use cpu"
        )
    torch.backends.cudnn.allow_tf32 = False  # it rounds what is multiplied to ten bits
    return device


def compile_for(function: Callable[P, R], device: torch.device) -> Callable[P, R]:
    """Return the function compiled by torch for a GPU, where launching kernels takes most time.

    It is returned as it is on a CPU, where the kernels take its place, and where Triton or a C compiler
    is missing. It is compiled once for each size of its arguments, at the first call.
    """
    compiler = os.environ.get("CC") or any(map(shutil.which, ("cc", "gcc", "clang")))
    if device.type == "cuda" and compiler and find_spec("triton"):
        return torch.compile(function, dynamic=False)
    return function


class CudaGraph:
    """A function of tensors, captured on a GPU at its first call and replayed by later ones.

    On a CPU it is called each time. On a GPU every call overwrites what the one before has returned.

    Args:
        function: takes tensors of the same sizes in every call; it neither synchronises nor copies from
            or to the CPU.
        device: where it runs.
        warm_up: calls before the capture, in which libraries make their plans and workspaces; 0 for a
            function that must not run more often than it is called.
    """

    def __init__(self, function: Callable[..., Any], device: torch.device, *, warm_up: int = 3) -> None:
        self.function, self.device, self.warm_up = function, device, warm_up
        self._graph: torch.cuda.CUDAGraph | None = None
        self._inputs: tuple[Tensor, ...] = ()
        self._outputs: Any = None

    def __call__(self, *inputs: Tensor) -> Any:
        """Return what the function returns for these inputs."""
        if self.device.type != "cuda":
            return self.function(*inputs)
        if self._graph is None:
            self._graph = self._capture(inputs)
        for slot, value in zip(self._inputs, inputs, strict=True):
            assert (slot.shape, slot.dtype) == (value.shape, value.dtype), (
                "a graph takes one size of inputs"
            )
            slot.copy_(value, non_blocking=True)
        self._graph.replay()
        return self._outputs

    def _capture(self, inputs: tuple[Tensor, ...]) -> torch.cuda.CUDAGraph:
        self._inputs = tuple(value.to(self.device, copy=True) for value in inputs)
        side, here = torch.cuda.Stream(self.device), torch.cuda.current_stream(self.device)
        side.wait_stream(here)
        with torch.cuda.stream(side):
            for _ in range(self.warm_up):
                self.function(*self._inputs)
        here.wait_stream(side)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.device(self.device), torch.cuda.graph(graph, capture_error_mode="thread_local"):
            self._outputs = self.function(*self._inputs)
        return graph
