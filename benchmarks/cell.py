"""A cell: one scene computed by one method with one seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.method import MethodEntry
from benchmarks.results.run_folder import RunFolder
from benchmarks.scene import Scene


@dataclass(frozen=True)
class Cell:
    """One scene met by one method with one seed; `suites` are those that report it."""

    scene: Scene
    entry: MethodEntry
    seed: int
    suites: tuple[str, ...]

    @property
    def method(self) -> str:
        return self.entry.name

    @property
    def label(self) -> str:
        return f"{self.scene.name} x {self.method}" + (f" (seed {self.seed})" if self.seed else "")

    @property
    def name(self) -> str:
        """<scene>/<method>, and the seed where it is not 0: as part of a path."""
        return f"{flat(self.scene.name)}/{flat(self.method)}" + (f"-seed{self.seed}" if self.seed else "")

    @property
    def timed(self) -> bool:
        """Whether its costs are measured; others run side by side."""
        return self.scene.timed and self.entry.timed

    def trajectory(self, folder: RunFolder) -> Path:
        return folder.trajectory_path(self.scene.name, self.method, self.seed)

    def curves(self, folder: RunFolder) -> Path:
        return folder.curves_path(self.scene.name, self.method, self.seed)

    def quasi_static(self, folder: RunFolder) -> Path:
        return folder.quasi_static_path(self.scene.name, self.method, self.seed)


def flat(name: str) -> str:
    """A name as part of a path."""
    return name.replace("/", "-")
