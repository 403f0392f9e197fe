"""Cell of a plan: one scene computed by one method with one seed.

A process that runs cells loads this module, and not the plan: its reader loads what no scene needs.
"""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.method import MethodEntry
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
        """<scene>/<method>, and the seed where it is not 0: part of paths and of ids."""
        return f"{flat(self.scene.name)}/{flat(self.method)}" + (f"-seed{self.seed}" if self.seed else "")

    @property
    def key(self) -> tuple[str, str, int]:
        """Scene, method and seed, by which RunFolder names its files."""
        return self.scene.name, self.method, self.seed

    @property
    def task_id(self) -> TaskId:
        """Id of the task that runs the cell."""
        return "cell", self.name

    @property
    def metrics_id(self) -> TaskId:
        """Id of the task that measures the cell's trajectory."""
        return "metrics", self.name

    @property
    def batch_id(self) -> TaskId:
        """Id of the task that times many bodies at once."""
        return "batch", self.name

    def repeat_id(self, number: int) -> TaskId:
        """Return the id of a repeat for its time alone; `number` counts from 1."""
        return "repeat", f"{self.name}-{number}"

    @property
    def timed(self) -> bool:
        """True if its costs are measured; other cells run side by side."""
        return self.scene.timed and self.entry.timed


def flat(name: str) -> str:
    """Return a name as part of a path.

    >>> flat("tshirt/walk")
    'tshirt-walk'
    """
    return name.replace("/", "-")
