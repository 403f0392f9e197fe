"""One frame of backward Euler: first guess, frozen terms, minimisation, and the state left to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, Step
from reference_sim.energies.inertia import Inertia
from reference_sim.minimise.descent import Result
from reference_sim.minimise.minimisers import StepMinimiser
from reference_sim.potential import Potential

if TYPE_CHECKING:
    from reference_sim.obstacle import Obstacle

LEAST_DT, MOST_DT = 1e-7, 1e4  # [s] of a step: beyond, one of its terms is lost in the round-off of the other
GUESSES = ("previous", "extrapolated", "body_transported")
# First guess (V, 3) [m] of the end of a step, from its number, 1 for the first, and its start (V, 3) [m]. The
# first step is asked for again where a start is checked.
FirstGuess = Callable[[int, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class State:
    """Positions and velocity between two frames."""

    x: np.ndarray  # (V, 3) [m]
    v: np.ndarray  # (V, 3) [m/s]


class TimeStepper:
    """Backward Euler from frame to frame: the potential, its minimiser, the rule for a first guess.

    All that many runs of one scene can share is set up here; `start_again` stands between two of them.

    Arguments and what is refused are those of `simulate`.
    """

    def __init__(
        self,
        cloth: Cloth,
        energies: Sequence[Energy],
        *,
        dt: float,
        substeps: int = 1,
        obstacle: Obstacle | None = None,
        guess: str | FirstGuess | None = None,
        quasi_static: bool = False,
        refreeze: int = 0,
        **options: Any,
    ) -> None:
        if substeps < 1:
            raise ValueError(f"simulate: substeps = {substeps}: must be at least 1")
        if 0 < (step := dt / substeps) < LEAST_DT or MOST_DT < step < float("inf"):
            raise ValueError(f"simulate: dt / substeps = {step:.3g} s: give {LEAST_DT:g} to {MOST_DT:g} s")
        if guess is None:
            guess = "extrapolated" if obstacle is None else "body_transported"
        if not callable(guess) and (
            guess not in GUESSES or (guess == "body_transported" and obstacle is None)
        ):
            raise ValueError(
                f"simulate: guess {guess!r}: choose one of {', '.join(GUESSES)}, or give a function;"
                " body_transported needs an obstacle"
            )
        if refreeze < 0:
            raise ValueError(f"simulate: refreeze = {refreeze}: must not be negative")
        self.cloth, self.guess, self.substeps, self.refreeze = cloth, guess, substeps, refreeze
        self.frame_dt, self.dt = dt, dt / substeps  # between frames, and of one step
        self.obstacle = obstacle if obstacle is None or substeps == 1 else obstacle.refined(substeps)
        self.potential = Potential([*energies, Inertia(cloth, self.dt)])
        self.quasi_static = quasi_static
        self.minimiser = StepMinimiser(self.potential, **options)

    def start_again(self) -> None:
        """Let the next run give the bits of a first one: minimisers forget what they have learned."""
        self.minimiser.start_again()

    def check_start(self, x: np.ndarray, v: np.ndarray) -> None:
        """Raise ValueError where x (V, 3) [m] at frame 0 is impossible for a term that nothing may pass."""
        if any(energy.joins_late for energy in self.potential.energies):
            self.prepare(1, x, v, x[self.cloth.pins])
            if infeasibility := self.potential.infeasibility(x):
                raise ValueError(f"simulate: the start is not free of intersections: {infeasibility}")

    def advance(self, frame: int, state: State, pins: np.ndarray | None) -> tuple[State | None, list[Result]]:
        """Take the sub-steps to `frame`, with pins (P, 3) [m] at its end.

        Returns:
            The state at the frame, None if a sub-step diverged, and the result of each sub-step, and of each
            time that it was solved again.

        Raises:
            ValueError: pins of another shape, or not finite.
        """
        x, v, results = state.x, state.v, []
        if pins is not None:
            pins, shape = np.asarray(pins, dtype=np.float64), (len(self.cloth.pins), 3)
            if pins.shape != shape or not np.isfinite(pins).all():
                what = f"simulate: pin_positions({frame}) gives {pins.shape}"
                raise ValueError(f"{what}: finite positions {shape} [m] are due")
        for j in range(1, self.substeps + 1):
            share = j / self.substeps
            handles = state.x[self.cloth.pins]
            if pins is not None:
                handles = (1 - share) * handles + share * pins
            step = (frame - 1) * self.substeps + j
            guess = self.prepare(step, x, v, handles)
            results.append(self.minimiser.minimise(x, guess))
            for _ in range(self.refreeze):
                if not np.isfinite(results[-1].positions).all():
                    break
                self.freeze(step, x, v, results[-1].positions)
                results.append(self.minimiser.minimise_from(results[-1].positions))
            y = results[-1].positions
            if results[-1].status == "diverged" or not np.isfinite(y).all():
                return None, results
            x, v = y, self.velocity(y, x)
        return State(x, v), results

    def velocity(self, x: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the velocity (V, 3) [m/s] that a step from `before` to x (V, 3) [m] ends with."""
        return np.zeros_like(x) if self.quasi_static else (x - before) / self.dt

    def prepare(self, step: int, x: np.ndarray, v: np.ndarray, handles: np.ndarray) -> np.ndarray:
        """Freeze every term for the step from x with velocity v (V, 3); return its first guess (V, 3) [m].

        handles: (P, 3) [m] where the pins are at the end of the step.

        Raises:
            ValueError: a function as guess gives another shape.
        """
        if callable(self.guess):
            first = np.array(self.guess(step, x.copy()), dtype=np.float64)
            if first.shape != x.shape:
                raise ValueError(f"simulate: guess of step {step} is {first.shape}: {x.shape} [m] is due")
        elif self.guess == "body_transported":
            assert self.obstacle is not None
            first = self.obstacle.transported(x, step, self.cloth.rest_positions)
        else:
            first = x + self.dt * v if self.guess == "extrapolated" else x.copy()
        first[self.cloth.pins] = handles
        self.freeze(step, x, v, first)
        return first

    def freeze(self, step: int, x: np.ndarray, v: np.ndarray, guess: np.ndarray) -> None:
        """Freeze every term for the step from x with velocity v (V, 3), as it is at the guess (V, 3)."""
        self.potential.prepare(Step(x, v, guess, self.dt, self.obstacle, step))

    def provenance(self) -> dict[str, Any]:
        """Return JSON values of the choices that decide the result, meshes apart."""
        minimiser = self.minimiser
        # The options have "newton" by default as well as by request, but L-BFGS opens a step by default.
        opening = {"opening": minimiser.opening_method} if minimiser.opening_method else {}
        return {
            "method": "backward Euler",
            "dt_s": self.frame_dt,
            "substeps": self.substeps,
            "guess": _as_json(self.guess),
            "quasi_static": self.quasi_static,
            "refreeze": self.refreeze,
            "options": {name: _as_json(value) for name, value in minimiser.options.items()},
            **opening,
            "terms": {energy.name: energy.parameters() for energy in self.potential.energies},
            "material": asdict(self.cloth.material),
        }


def _as_json(option: Any) -> Any:
    """Return a value of JSON for an option: of a function its name, of a partial one its arguments too."""
    if isinstance(option, partial):
        named = {name: _as_json(value) for name, value in option.keywords.items()}
        return [_as_json(option.func), *map(_as_json, option.args), named]
    return getattr(option, "__name__", type(option).__name__) if callable(option) else option
