"""Engines, the sheets that they move, and what they do with them: roll-outs, with their time.

Specimens are sheets of SNUG's fabric that fall, fly, hang and come to rest. Their mesh is the union jack,
whose mirror image in x is the mesh itself.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from typing import NamedTuple

import numpy as np

from benchmarks.meshes import rectangle
from reference_sim import Cloth, Material
from reference_sim.energies import Energy

FRAME = 1 / 30  # [s] between frames
FAR = 100.0  # [m] from the origin, where a vertex has flown away
CELLS = 16  # a side: 17 x 17 vertices
SPEED, SPIN = 1.0, 10.0  # [m/s], [1/s] of the thrown sheet
SECOND, REST = 30, 90  # frames after the start


class EngineDiverged(RuntimeError):
    """A vertex is nowhere, or flew away; the message says in which frame."""


@dataclass(frozen=True, eq=False)
class Specimen:
    """A sheet at frame 0.

    Attributes:
        cloth: rest state and pins, in SNUG's fabric.
        start: positions (V, 3) [m].
        velocity: (V, 3) [m/s].
        frames: that follow.
    """

    cloth: Cloth
    start: np.ndarray
    velocity: np.ndarray
    frames: int = SECOND

    @property
    def mirrored(self) -> np.ndarray:
        """Vertex (V,) that is the mirror image of each in the plane x = 0, by the rest positions."""
        image = self.cloth.rest_positions * [-1.0, 1.0, 1.0]
        return np.array([np.abs(self.cloth.rest_positions - x).sum(axis=1).argmin() for x in image])


@cache
def specimen(name: str) -> Specimen:
    """Return a specimen, made once.

    Args:
        name: "falling", a free horizontal square of 1 m at rest; "thrown", moving along x and spinning
            about the vertical, which stretches it; "hanging", held by two corners; "strip", a vertical
            strip of 0.25 m by 1 m held by its upper edge, without tension.
    """
    if name == "strip":
        points, faces = rectangle("union_jack", CELLS // 4, CELLS, 0.25, 1.0)
        x = np.stack([points[:, 0] - 0.125, points[:, 1], np.zeros(len(points))], axis=1)
        cloth = Cloth(x, faces, Material(), pins=np.flatnonzero(x[:, 1] > 0.999).tolist())
        return Specimen(cloth, x, np.zeros_like(x), REST)
    points, faces = rectangle("union_jack", CELLS, CELLS, 1.0, 1.0)
    x = np.stack([points[:, 0] - 0.5, np.zeros(len(points)), points[:, 1] - 0.5], axis=1)
    corners = np.flatnonzero((np.abs(x[:, 0]) > 0.499) & (x[:, 2] < -0.499)).tolist()
    cloth = Cloth(x, faces, Material(), pins=corners if name == "hanging" else [])
    spin = SPIN * np.stack([x[:, 2], np.zeros(len(x)), -x[:, 0]], axis=1)
    moving = spin + np.array([SPEED, 0.0, 0.0])
    return Specimen(cloth, cloth.rest_positions, moving if name == "thrown" else np.zeros_like(x))


class EngineCloth:
    """Cloth of an engine, ready to step. An adapter defines `advance`.

    Attributes:
        energies: static terms that the engine minimises, gravity aside; empty where they are not
            documented.
        explicit: forces of a time step are those at its start; otherwise those at its end.
    """

    energies: Sequence[Energy] = ()
    explicit: bool = False

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (V, 3) [m] and velocities [m/s] a time step of dt [s] after x and v."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Declaration of an engine: nothing is imported before `make`.

    Attributes:
        name: without a slash; first part of the names of its known answers.
        title: for people.
        module: that is imported, named as its distribution, whose version counts; empty for the project.
        substeps, iterations: of its default settings, per frame of 1/30 s and per time step.
        settings: where these defaults come from.
        iterates: whether a larger budget has more iterations; otherwise it has more sub-steps.
        factors: of the budgets, the default first.
        make: (cloth, iterations) -> EngineCloth.
    """

    name: str
    title: str
    module: str = ""
    substeps: int
    iterations: int = 1
    settings: str
    iterates: bool = True
    factors: tuple[int, ...] = (1, 4, 16, 64)
    make: Callable[[Cloth, int], EngineCloth]

    @property
    def absent(self) -> str:
        """Why it cannot run, with the command that mends it; empty where it is installed."""
        if not self.module or importlib.util.find_spec(self.module) is not None:
            return ""
        return f"{self.title} is not installed: pip install 'neural-garment-benchmark[engines]'"

    @property
    def version(self) -> str:
        """Name, version and licence, for every row."""
        if self.module:
            return f"{self.module} {metadata.version(self.module)}, Apache-2.0"
        return f"this project {metadata.version('neural-garment-benchmark')}, MIT"


class Step(NamedTuple):
    """One time step: from x, v (V, 3) [m, m/s] to `after` (V, 3) [m]."""

    x: np.ndarray
    v: np.ndarray
    after: np.ndarray


@dataclass(frozen=True, eq=False)
class RollOut:
    """Roll-out of an engine.

    Attributes:
        specimen: that moved.
        positions: (T, V, 3) [m], the start included.
        velocity: (V, 3) [m/s] at the end.
        seconds: processor time (T-1,) [s] of each frame.
        step: time step of the engine [s].
        last_steps: last time step of each frame.
        cloth: of the engine.
    """

    specimen: Specimen
    positions: np.ndarray
    velocity: np.ndarray
    seconds: np.ndarray
    step: float
    last_steps: Sequence[Step]
    cloth: EngineCloth

    @property
    def milliseconds(self) -> float:
        """Processor time of a frame [ms], the mean."""
        return 1e3 * float(self.seconds.mean())


def roll_out(engine: Engine, sample: Specimen, factor: int = 1) -> RollOut:
    """Let an engine move a specimen with `factor` times its default budget.

    Time is the processor's, so that other work on the machine does not count. All of it is done twice,
    and the second time counts: what a roll-out needs first in a late frame compiles or loads there.

    Raises:
        EngineDiverged: it did not come to the end.
        ImportError: the engine is not installed.
    """
    substeps = engine.substeps * (1 if engine.iterates else factor)
    cloth = engine.make(sample.cloth, engine.iterations * (factor if engine.iterates else 1))
    for _ in range(2):
        x, v, dt = sample.start, sample.velocity, FRAME / substeps
        steps, seconds = [], []
        for number in range(1, sample.frames + 1):
            clock = time.process_time()
            for _ in range(substeps):
                before = x, v
                x, v = cloth.advance(x, v, dt)
            seconds.append(time.process_time() - clock)
            if not (np.isfinite(x).all() and np.abs(x).max() < FAR):
                raise EngineDiverged(f"frame {number}: a vertex is nowhere, or {FAR:g} m away")
            steps.append(Step(*before, x))
    positions = np.array([sample.start, *(step.after for step in steps)])
    return RollOut(sample, positions, v, np.array(seconds), dt, steps, cloth)
