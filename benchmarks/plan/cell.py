"""Cell of a plan: one scene computed by one method with one seed.

A process that runs cells loads this module, and not the plan, which loads what no scene needs.
"""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.method import MethodEntry
from benchmarks.results.run_folder import cell_name, flat
from benchmarks.scene import Scene

TaskId = tuple[str, str]  # kind and name of a task


@dataclass(frozen=True)
class Cell:
    """One scene computed by one method with one seed; `suites` are those that report it."""

    scene: Scene
    entry: MethodEntry
    seed: int
    suites: tuple[str, ...]

    @property
    def method(self) -> str:
        """Name of the method."""
        return self.entry.name

    @property
    def label(self) -> str:
        """Scene, method and seed for messages."""
        return f"{self.scene.name} x {self.method}" + (f" (seed {self.seed})" if self.seed else "")

    @property
    def name(self) -> str:
        """Part of the paths of its files, and of ids."""
        return cell_name(*self.key)

    @property
    def key(self) -> tuple[str, str, int]:
        """Scene, method and seed, by which RunFolder names its files."""
        return self.scene.name, self.method, self.seed

    def id(self, kind: str = "cell", number: int = 0) -> TaskId:
        """Return the id of a task of the cell: cell, batch, metrics, or repeat, from 1."""
        return kind, self.name + (f"-{number}" if number else "")

    @property
    def timed(self) -> bool:
        """True if its costs are measured; other cells run side by side."""
        return self.scene.timed and self.entry.timed


def id_of(kind: str, scene: Scene) -> TaskId:
    """Return the id of a task of a scene: start, or quasi-static."""
    return kind, flat(scene.name)
