"""Roll-outs of engines on specimens: what they do, and the time that they take."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.engines.engine import FRAME, Engine
from benchmarks.engines.registry import find_engine
from benchmarks.engines.specimens import Specimen, specimen
from reference_sim.energies.energy import Energy

FAR = 100.0  # [m] from the origin, where a vertex has flown away


@dataclass(frozen=True, eq=False)
class Step:
    """One time step: from x, v (V, 3) [m, m/s] to `after` (V, 3), dt [s] later."""

    x: np.ndarray
    v: np.ndarray
    after: np.ndarray
    dt: float


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

    Time is the processor's, so that other work on the machine does not count; the first frame is done once
    more before, so that nothing compiles on the clock.

    Raises:
        EngineDiverged: it did not come to the end.
        ImportError: the engine is not installed.
    """
    substeps, iterations = engine.budget(factor)
    cloth, dt = engine.make(sample, iterations), FRAME / substeps

    def last_step(x: np.ndarray, v: np.ndarray) -> tuple[Step, np.ndarray]:
        """Return the last time step of the frame after x and v, and the velocity at its end."""
        for _ in range(substeps):
            before = x, v
            x, v = cloth.advance(x, v, dt)
        return Step(*before, x, dt), v

    last_step(sample.start, sample.velocity)
    positions, velocity, seconds, steps = [sample.start], sample.velocity, [], []
    for number in range(1, sample.frames + 1):
        clock = time.process_time()
        step, velocity = last_step(positions[-1], velocity)
        seconds.append(time.process_time() - clock)
        if not (np.isfinite(step.after).all() and np.abs(step.after).max() < FAR):
            raise EngineDiverged(f"frame {number}: a vertex is nowhere, or {FAR:g} m away")
        positions.append(step.after)
        steps.append(step)
    return RollOut(
        sample, np.array(positions), velocity, np.array(seconds), dt, steps, cloth.energies, cloth.explicit
    )


@cache
def cached_roll_out(engine: str, sample: str, factor: int = 1) -> RollOut:
    """Return the roll-out of a declared engine on a declared specimen, done once in this process."""
    return roll_out(find_engine(engine), specimen(sample), factor)
