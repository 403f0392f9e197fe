"""Devices that networks train on: `cpu`, `cuda`; an absent one is refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import torch

CPU = torch.device("cpu")
P = ParamSpec("P")
R = TypeVar("R")


class DeviceError(ValueError):
    """A device that this machine does not have; the message says what to use instead."""


def find_device(name: str) -> torch.device:
    """Return the device `cpu`, `cuda` or `cuda:1`. Raises DeviceError for an unknown or absent one."""
    try:
        device = torch.device(name)
    except RuntimeError:
        raise DeviceError(f"--device {name}: unknown; use cpu or cuda") from None
    if device.type == "cpu":
        return device
    if device.type != "cuda":
        raise DeviceError(f"--device {name}: use cpu or cuda")
    if not torch.cuda.is_available():
        why = "this torch was built without CUDA" if torch.version.cuda is None else "no CUDA device answers"
        raise DeviceError(f"--device {name}: {why}; use --device cpu")
    if (device.index or 0) >= torch.cuda.device_count():
        raise DeviceError(f"--device {name}: this machine has {torch.cuda.device_count()} CUDA device(s)")
    torch.backends.cudnn.allow_tf32 = False  # recurrent units would round their products to ten bits
    return device


def compiled(function: Callable[P, R], device: torch.device) -> Callable[P, R]:
    """Return the function compiled by torch for a GPU, where a thousand small operations wait for Python.

    On a CPU it is returned as it is: there the kernels take its place. It is compiled once for each size of
    its arguments, at the first call.
    """
    return torch.compile(function, dynamic=False, fullgraph=True) if device.type == "cuda" else function
