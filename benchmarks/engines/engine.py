"""Engine: declaration of a cloth solver under test, and what its adapter has to do."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.provenance import package_version

if TYPE_CHECKING:
    from benchmarks.engines.specimens import Specimen
    from reference_sim.energies.energy import Energy

FRAME = 1 / 30  # [s] between frames
FAR = 100.0  # [m] from the origin, where a vertex has flown away
ITERATIONS, SUBSTEPS = "iterations", "substeps"


class EngineCloth:
    """Cloth of an engine, ready to step. An adapter defines `advance`.

    Attributes:
        energies: static terms that the engine minimises, gravity aside; empty where they are not documented.
        explicit: forces of a time step are those at its start; otherwise those at its end.
    """

    energies: Sequence[Energy] = ()
    explicit: bool = False

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (V, 3) [m] and velocities [m/s] a time step of dt [s] after x and v."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Declaration of an engine: cheap to list, nothing is imported before `make`.

    Attributes:
        name: without a slash; first part of the names of its cases.
        title: for people.
        module: that is imported, named as its distribution, whose version counts; empty for the project.
        licence: SPDX identifier.
        install: command that installs it.
        substeps, iterations: of its default settings, per frame of 1/30 s and per time step.
        settings: where these defaults come from.
        grows: ITERATIONS or SUBSTEPS, what is multiplied to give it a larger budget.
        factors: of the budgets, the default first.
        make: (specimen, iterations) -> EngineCloth.
    """

    name: str
    title: str
    module: str = ""
    licence: str
    install: str = ""
    substeps: int
    iterations: int = 1
    settings: str
    grows: str = ITERATIONS
    factors: tuple[int, ...]
    make: Callable[[Specimen, int], EngineCloth]

    @property
    def absent(self) -> str:
        """Why it cannot run, with the command that mends it; empty where it is installed."""
        if not self.module or importlib.util.find_spec(self.module) is not None:
            return ""
        return f"{self.title} is not installed: {self.install}"

    @property
    def version(self) -> str:
        """Name, version and licence, for every row."""
        version = package_version(self.module or "neural-garment-benchmark")
        return f"{self.module or 'this project'} {version}, {self.licence}"

    def budget(self, factor: int) -> tuple[int, int]:
        """Return sub-steps per frame and iterations per time step of that multiple of the default."""
        if self.grows == SUBSTEPS:
            return factor * self.substeps, self.iterations
        return self.substeps, factor * self.iterations
