"""Roll-outs of engines on specimens: what they do, and the time that they take."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.engines.engine import FAR, FRAME, Engine, EngineCloth
from benchmarks.engines.registry import find_engine
from benchmarks.engines.specimens import Specimen, specimen
from reference_sim.energies.energy import Energy


@dataclass(frozen=True, eq=False)
class Step:
    """One time step: from x, v (V, 3) [m, m/s] to `after` (V, 3)."""

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
        energies, explicit: as those of EngineCloth.
    """

    specimen: Specimen
    positions: np.ndarray
    velocity: np.ndarray
    seconds: np.ndarray
    step: float
    last_steps: Sequence[Step]
    energies: Sequence[Energy]
    explicit: bool

    @property
    def milliseconds(self) -> float:
        """Processor time of a frame [ms], the mean."""
        return 1e3 * float(self.seconds.mean())


class EngineDiverged(RuntimeError):
    """A vertex is nowhere, or flew away; the message says in which frame."""


def roll_out(engine: Engine, sample: Specimen, factor: int = 1) -> RollOut:
    """Let an engine move a specimen with `factor` times its default budget.

    Time is the processor's, so that other work on the machine does not count. All of it is done twice, and
    the second time counts: what a roll-out needs first in a late frame compiles or loads there.

    Raises:
        EngineDiverged: it did not come to the end.
        ImportError: the engine is not installed.
    """
    substeps, iterations = engine.budget(factor)
    cloth = engine.make(sample, iterations)
    _all_frames(cloth, sample, substeps)
    steps, velocity, seconds = _all_frames(cloth, sample, substeps)
    positions = np.array([sample.start, *(step.after for step in steps)])
    return RollOut(
        sample, positions, velocity, np.array(seconds), FRAME / substeps, steps, cloth.energies,
        cloth.explicit,
    )  # fmt: skip


def _all_frames(
    cloth: EngineCloth, sample: Specimen, substeps: int
) -> tuple[list[Step], np.ndarray, list[float]]:
    """Return the last time step of each frame, the velocity (V, 3) [m/s] at the end, the time of each [s]."""
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
    return steps, v, seconds


@cache
def cached_roll_out(engine: str, sample: str, factor: int = 1) -> RollOut:
    """Return the roll-out of a declared engine on a declared specimen, done once in this process."""
    return roll_out(find_engine(engine), specimen(sample), factor)
