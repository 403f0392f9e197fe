"""Roll-outs of engines on specimens: what they do, and the time that they take."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice

import numpy as np

from benchmarks.engines.engine import FRAME, Engine, EngineCloth
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
        velocity: (V, 3) [m/s] at the end; None where the engine does not tell.
        seconds: processor time (T-1,) [s] of each frame.
        step: time step of the engine [s].
        last_steps: last time step of each frame; empty where the engine does not tell.
        energies, explicit: as those of EngineCloth.
    """

    specimen: Specimen
    positions: np.ndarray
    velocity: np.ndarray | None
    seconds: np.ndarray
    step: float
    last_steps: Sequence[Step] = ()
    energies: Sequence[Energy] = ()
    explicit: bool = False

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
    cloth: EngineCloth = engine.make(sample, iterations)
    next(cloth.frames(sample, substeps))
    positions, seconds, steps, velocity = [sample.start], [], [], None
    frames = islice(cloth.frames(sample, substeps), sample.frames)
    clock = time.process_time()
    for number, frame in enumerate(frames, start=1):
        seconds.append(time.process_time() - clock)
        if not (np.isfinite(frame.x).all() and np.abs(frame.x).max() < FAR):
            raise EngineDiverged(f"frame {number}: a vertex is nowhere, or {FAR:g} m away")
        positions.append(frame.x)
        velocity = frame.v
        if frame.before is not None:
            steps.append(Step(*frame.before, frame.x, FRAME / substeps))
        clock = time.process_time()
    return RollOut(
        sample, np.array(positions), velocity, np.array(seconds), FRAME / substeps, steps, cloth.energies,
        cloth.explicit,
    )  # fmt: skip


@cache
def cached_roll_out(engine: str, sample: str, factor: int = 1) -> RollOut:
    """Return the roll-out of a declared engine on a declared specimen, done once in this process."""
    return roll_out(find_engine(engine), specimen(sample), factor)
