"""The reference as an engine: backward Euler by Newton's method, stopped after so many iterations."""

from __future__ import annotations

import numpy as np

from benchmarks.engines.engine import EngineCloth
from benchmarks.engines.specimens import Specimen
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.time_step import State, TimeStepper


class ReferenceCloth(EngineCloth):
    """Specimen under the energies of the paper."""

    def __init__(self, specimen: Specimen, iterations: int) -> None:
        self.cloth = specimen.cloth
        self.energies = (StretchStVK(self.cloth), BendHinge(self.cloth))
        self.iterations = iterations
        self._steppers: dict[float, TimeStepper] = {}

    def advance(self, x: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Take one step. Raises ValueError where it diverges."""
        if dt not in self._steppers:
            terms = [*self.energies, Gravity(self.cloth)]
            self._steppers[dt] = TimeStepper(
                self.cloth, terms, dt=dt, method="newton", max_iterations=self.iterations
            )
        after, (result,) = self._steppers[dt].advance(1, State(x, v), None)
        if after is None:
            raise ValueError(f"the reference diverged: {result.reason}")
        return after.x, after.v
