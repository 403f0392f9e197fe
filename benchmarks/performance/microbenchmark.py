"""Microbenchmark: some measured numbers of one case, alone on the machine in a process of its own.

Times are medians of repeats inside that process. They belong to the machine that
they were taken on: compare ratios.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from benchmarks.training import Training

SUITE = "performance"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a run that a measuring function reads.

    Attributes:
        repeats: of what is timed.
        training: of the network, kind and recipe; None for a method that is no network.
        device, steps: of its training.
        files: to be left behind.
        key: equal where an interrupted training may go on.
    """

    repeats: int
    training: Training | None = None
    device: str = "cpu"
    steps: int = 0
    files: tuple[Path, ...] = ()
    key: str = ""


@dataclass(frozen=True, kw_only=True)
class Microbenchmark:
    """Declaration of a microbenchmark: cheap to list. Its module is imported when it is measured.

    `function` of `module`, called with Settings and `options`, returns numbers by the names of metrics.py,
    the suite's name left out.

    Attributes:
        name: "<part>/<case>", the scene of its rows.
        method: that of its rows: "simulation", or the network.
        module: dotted; with all that it imports it is what the rows depend on.
        trains: whether it trains: on the run's device, for as many steps as the preset trains the method.
        files: what it leaves, by their names in the run's folder.
        smoke: whether the smallest preset runs it.
        long: whether it is run only where its whole name is given.
    """

    name: str
    description: str
    module: str
    function: str = "measure"
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    method: str = "simulation"
    repeats: int = 5
    trains: bool = False
    files: tuple[str, ...] = ()
    smoke: bool = False
    long: bool = False

    @property
    def label(self) -> str:
        """Name of its task: case and method."""
        return f"{self.name} x {self.method}"

    def measure(self, settings: Settings) -> dict[str, float]:
        """Return metric -> value. Raises what the function raises."""
        function = getattr(importlib.import_module(self.module), self.function)
        measured = function(settings, **self.options)
        return {f"{SUITE}/{name}": value for name, value in measured.items()}
