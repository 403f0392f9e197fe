"""A network's frame, or skinning's, as the first guess of a step, and a few iterations of a solver from it.

The state is carried: x_hat comes from the method's own two previous frames, so that inertia acts, while the
network sees what it always sees. The potential of the step is frozen as for every solver (contact planes at
the guess that the body carries), and only the starting point differs. The time of the network or of skinning
is that of run(); posed body, features and joint transforms are ready before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reference_sim import Potential, Trajectory
from reference_sim.minimise import Minimiser, Result, make_minimiser

from ..method import Method, posed_body
from ..results import model_path
from ..scene import BuiltScene
from .simulation import Simulation

SKINNING = "skinning"


class FromElsewhere:
    """A minimiser that starts each step where `starts` says, whatever guess it is given."""

    def __init__(self, inner: Minimiser, starts: Iterator[np.ndarray], pins: np.ndarray) -> None:
        self._inner, self._starts, self._pins = inner, starts, pins

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from the next start; pinned vertices stay where x0 (V, 3) [m] has them."""
        start = next(self._starts)
        start[self._pins] = x0[self._pins]
        return self._inner.minimise(start)


@dataclass
class WarmStarted(Method):
    """A simulation whose steps start at frames from elsewhere and are cut short."""

    guess: str
    path: Path
    solver: dict[str, Any]
    simulation: Simulation = field(init=False)
    of_guess: Callable[[int], object] = field(init=False)

    def prepare(self, scene: BuiltScene) -> None:
        frames = self._frames(scene)

        def from_elsewhere(potential: Potential, **options: Any) -> FromElsewhere:
            starts = frames()
            next(starts)  # frame 0 is the scene's start, as for every solver
            inner = make_minimiser(potential, **self.solver)
            return FromElsewhere(inner, starts, np.asarray(potential.cloth.pins))

        self.simulation = Simulation(options={"method": from_elsewhere})
        self.simulation.prepare(scene)

    def run(self) -> Trajectory:
        return self.simulation.run()

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Those of the network or of skinning, and the posed body."""
        assert scene.dressed is not None
        body = posed_body(scene.dressed)
        return lambda frame: (self.of_guess(frame), body(frame))

    def _frames(self, scene: BuiltScene) -> Callable[[], Iterator[np.ndarray]]:
        """What gives world positions (V, 3) [m] frame after frame, from the first one on, at each call."""
        from snug.dressed_body import DressedBody
        from snug.recipe import DEFAULT
        from snug.rollout import frame_inputs, predictions, skinned_frames
        from snug.trained_model import TrainedModel

        assert scene.dressed is not None
        motion, betas, before = scene.dressed.motion, scene.dressed.betas, scene.dressed.before
        dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        model = None if self.guess == SKINNING else TrainedModel.load(self.path)
        self.of_guess = frame_inputs(model, dressed, motion, betas, before=before)
        if model is None:
            return skinned_frames(dressed, motion, DEFAULT.smoothing, betas)
        return predictions(model, dressed, motion, betas, before=before)


def make(*, models: Path, seed: int, guess: str, solver: str, iterations: int) -> WarmStarted:
    """`iterations` of "newton" or "lbfgs" from the network of kind `guess`, or from "skinning"."""
    options: dict[str, Any] = {"method": solver, "max_iterations": iterations}
    options |= {"finish": False} if solver == "lbfgs" else {"start_projected": True}
    return WarmStarted(guess, model_path(models, guess, seed), options)
