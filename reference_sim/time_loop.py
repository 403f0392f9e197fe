"""The loop over frames, and one frame of it: backward Euler as a sequence of minimisations.

    x_{t+1} = argmin  1/(2 dt^2) (x - x_hat)^T M (x - x_hat) + Phi(x),   x_hat = x_t + dt v_t

(SNUG, eq. 4; Martin et al. 2011; Gast et al. 2015). The velocity of the next step is (x_{t+1} - x_t) /
dt. With sub-steps a stored frame is n such steps of dt / n, pins and obstacle moving linearly in between.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.command_line import progress_bar
from reference_sim.energies.energy import Energy, Step
from reference_sim.energies.inertia import Inertia
from reference_sim.minimise.descent import STATUSES, Result
from reference_sim.minimise.minimisers import StepMinimiser
from reference_sim.potential import Potential
from reference_sim.trajectory import Trajectory

if TYPE_CHECKING:
    from reference_sim.obstacle import Obstacle

GUESSES = ("previous", "extrapolated", "body_transported")  # the last needs an obstacle
FirstGuess = Callable[[int, np.ndarray], np.ndarray]  # see `TimeStepper`


@dataclass(frozen=True, eq=False)
class State:
    """Positions and velocity between two frames."""

    x: np.ndarray  # (V, 3) [m]
    v: np.ndarray  # (V, 3) [m/s]


class TimeStepper:
    """Backward Euler from frame to frame: the potential, its minimiser, the rule for a first guess.

    All that many runs of one scene can share is set up here; `minimiser.start_again` stands between two.

    Args:
        energies, dt, obstacle: as in `simulate`.
        substeps: backward-Euler steps per frame. Each is a minimisation; frame fields then hold sums of
            counts, the worst gradient norm, and the energies of the last sub-step.
        guess: initial guess of a step: "previous", "extrapolated" (x + dt v), or "body_transported",
            moved along with the obstacle's nearest faces (default where there is an obstacle; else
            "extrapolated"); or a function of the step's number, 1 for the first of a run, and its start
            (V, 3) [m] that returns positions (V, 3) [m]. Pins are then put in place, and contact planes
            are taken there. The first step is asked for twice where a start is checked, so the answer
            should depend on the arguments alone.
        quasi_static: set the velocity to zero after every step, sub-steps included; for settling.
        refreeze: times that what is frozen in a step, as contact planes, is searched again where the step
            has ended, and the step solved again from there.
        options: of the minimiser: method ("newton", "lbfgs", which Newton's method finishes, or a
            function that makes one of a potential and the other options), tolerance, max_iterations,
            timeout [s] of one minimisation, ... The default method is "lbfgs", or "newton" with a term
            whose pairs change with x, as a barrier's do. Where such a term joins a step late
            (self-contact alone), the method is that of the minimisation without the term, by default
            "lbfgs", and Newton's method ends the step.

    Raises ValueError for an unknown guess, fewer than 1 sub-step, a time step or tolerance not above 0, a
    function as method beside a term that joins a step late, which Newton's method ends.
    """

    def __init__(
        self,
        cloth: Cloth,
        energies: Sequence[Energy],
        *,
        dt: float = 1 / 30,
        substeps: int = 1,
        obstacle: Obstacle | None = None,
        guess: str | FirstGuess | None = None,
        quasi_static: bool = False,
        refreeze: int = 0,
        **options: Any,
    ) -> None:
        if substeps < 1:
            raise ValueError(f"simulate: substeps = {substeps}: must be at least 1")
        if guess is None:
            guess = "extrapolated" if obstacle is None else "body_transported"
        if not callable(guess) and guess not in (GUESSES[:-1] if obstacle is None else GUESSES):
            raise ValueError(
                f"simulate: guess {guess!r}: choose one of {', '.join(GUESSES)}, or give a function;"
                " body_transported needs an obstacle"
            )
        self.cloth, self.guess, self.substeps, self.refreeze = cloth, guess, substeps, refreeze
        self.frame_dt, self.dt = dt, dt / substeps  # between frames, and of one step
        self.obstacle = obstacle if obstacle is None or substeps == 1 else obstacle.refine(substeps)
        self.potential = Potential([*energies, Inertia(cloth, self.dt)])
        self.quasi_static = quasi_static
        self.minimiser = StepMinimiser(self.potential, **options)

    def advance(
        self, frame: int, state: State, pins: np.ndarray | None
    ) -> tuple[State | None, list[Result]]:
        """Take the sub-steps to `frame`, with pins (P, 3) [m] at its end.

        Returns the state at the frame, None if a sub-step diverged, and the result of each sub-step, also
        of each time that it was solved again.
        """
        x, v, results = state.x, state.v, []
        if pins is not None:
            pins = _finite(pins, (len(self.cloth.pins), 3), f"pin_positions({frame})")
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
            x, v = y, np.zeros_like(y) if self.quasi_static else (y - x) / self.dt
        return State(x, v), results

    def prepare(self, step: int, x: np.ndarray, v: np.ndarray, handles: np.ndarray) -> np.ndarray:
        """Freeze every term for the step from x with velocity v (V, 3); return its first guess (V, 3) [m].

        handles: (P, 3) [m] where the pins are at the end of the step.
        """
        if callable(self.guess):
            first = np.array(self.guess(step, x.copy()), dtype=np.float64)
            if first.shape != x.shape:
                raise ValueError(f"simulate: guess of step {step} is {first.shape}: {x.shape} [m] is due")
        elif self.guess == "body_transported":
            assert self.obstacle is not None
            first = self.obstacle.transport(x, step, self.cloth.rest_positions)
        else:
            first = x + self.dt * v if self.guess == "extrapolated" else x.copy()
        first[self.cloth.pins] = handles
        self.freeze(step, x, v, first)
        return first

    def freeze(self, step: int, x: np.ndarray, v: np.ndarray, guess: np.ndarray) -> None:
        """Freeze every term for the step from x with velocity v (V, 3), as it is at the guess (V, 3)."""
        self.potential.prepare(Step(x, v, guess, self.dt, self.obstacle, step))

    def simulate(
        self,
        *,
        frames: int = 60,
        start: np.ndarray | None = None,
        velocity: np.ndarray | None = None,
        pin_positions: Callable[[int], np.ndarray] | None = None,
        progress: str | None = None,
    ) -> Trajectory:
        """Simulate as the function `simulate` does."""
        if frames < 1:
            raise ValueError(f"simulate: frames = {frames}: must be at least 1")
        rest = self.cloth.rest_positions
        x = _finite(rest if start is None else start, rest.shape, "start")
        pins = x[self.cloth.pins]
        if pin_positions is None and self.obstacle and self.obstacle.moves_beside(pins):
            raise ValueError(
                f"simulate: the obstacle beside {len(pins)} pins moves: give pin_positions, as "
                "obstacle.carrying(pins) that lets them ride on it, or lambda frame: pins"
            )
        v = _finite(np.zeros_like(rest) if velocity is None else velocity, rest.shape, "velocity")
        provenance = self.provenance()
        if any(energy.dynamic for energy in self.potential.energies):
            self.prepare(1, x, v, pins)
            if infeasibility := self.potential.infeasibility(x):
                raise ValueError(
                    f"simulate: the start is not free of intersections: {infeasibility}: mend the mesh "
                    "there, or simulate without self-contact"
                )
        state, status, reason = State(x, v), "converged", ""
        positions, seconds, fields = [x], [0.0], [_fields_of_start(self.potential.energies)]
        numbers: Iterable[int] = range(1, frames)
        if progress is not None:
            numbers = progress_bar(numbers, desc=progress, unit="frame", initial=1, total=frames)
        for frame in numbers:
            clock = time.perf_counter()
            after, results = self.advance(frame, state, pin_positions and pin_positions(frame))
            elapsed = time.perf_counter() - clock
            status, reason = _judge(status, reason, frame, results)
            if after is None:
                break
            state = after
            positions.append(state.x)
            seconds.append(elapsed)
            fields.append(_fields(results))
        return Trajectory(
            positions=np.array(positions),
            faces=self.cloth.faces,
            times=self.frame_dt * np.arange(float(len(positions))),
            frame_seconds=np.array(seconds),
            status=status,
            reason=reason,
            provenance=provenance,
            frame_fields={name: np.array([f[name] for f in fields]) for name in fields[0]},
        )

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


def simulate(
    cloth: Cloth,
    energies: Sequence[Energy],
    *,
    dt: float = 1 / 30,
    frames: int = 60,
    obstacle: Obstacle | None = None,
    start: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    pin_positions: Callable[[int], np.ndarray] | None = None,
    progress: str | None = None,
    **options: Any,
) -> Trajectory:
    """Simulate `frames` frames, the start included.

    Args:
        cloth: the rest state; its pins stay where `start` has them unless pin_positions moves them.
        energies: the terms of Phi. Inertia is added here; no other term is.
        dt: time between frames [s].
        frames: number of frames T in the result.
        obstacle: the moving body, one mesh per frame.
        start: (V, 3) [m] at frame 0; default the rest positions.
        velocity: (V, 3) [m/s] at frame 0; default zero.
        pin_positions: frame -> (P, 3) [m], for handles that move; see `Obstacle.carrying`.
        progress: label of a progress bar with time left; None for silence.
        options: of a `time_loop.TimeStepper` and its minimiser: guess, substeps, quasi_static, refreeze,
            method, tolerance, max_iterations, timeout, ...

    Returns:
        A Trajectory. A frame that is not finite ends the run. frame_fields: iterations, factorisations,
        gradient_norm (relative residual, see `Result`), converged (0/1), relaxed (1 where the residual is
        within the tolerance up to round-off alone; the reason tells of the first), energy/<term> [J].

    Raises:
        ValueError: wrong shapes (of a guess too), fewer than 1 frame, what a `TimeStepper` refuses, pins
            beside a moving obstacle without pin_positions.

    Example: a triangle that one corner holds falls by g dt^2 in the first step.

        >>> import numpy as np
        >>> from reference_sim import Cloth, simulate
        >>> from reference_sim.energies import Gravity
        >>> triangle = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
        >>> cloth = Cloth(triangle, np.array([[0, 2, 1]]), pins=[0])
        >>> fall = simulate(cloth, [Gravity(cloth)], dt=0.01, frames=3)
        >>> fall.status, fall.positions.shape
        ('converged', (3, 3, 3))
        >>> fall.positions[:, 1, 1].round(6).tolist()
        [0.0, -0.000981, -0.002943]
    """
    return TimeStepper(cloth, energies, dt=dt, obstacle=obstacle, **options).simulate(
        frames=frames, start=start, velocity=velocity, pin_positions=pin_positions, progress=progress
    )


def _judge(status: str, reason: str, frame: int, results: Sequence[Result]) -> tuple[str, str]:
    """Return status and reason of a run after the minimisations on the way to `frame`.

    The worst counts, the first of equally bad ones; else the first that round-off excused has the reason.
    """
    for result in results:
        if STATUSES[result.status] > STATUSES[status] or (result.relaxed and not reason):
            status, reason = result.status, f"frame {frame}: {result.reason}"
    return status, reason


def _fields_of_start(energies: Sequence[Energy]) -> dict[str, float]:
    """Return the fields of frame 0, which is given and was not minimised."""
    counts = {"iterations": 0.0, "factorisations": 0.0, "gradient_norm": np.nan}
    counts |= {"converged": 1.0, "relaxed": 0.0}
    return counts | {f"energy/{energy.name}": np.nan for energy in energies}


def _fields(results: Sequence[Result]) -> dict[str, float]:
    return {
        "iterations": float(sum(result.iterations for result in results)),
        "factorisations": float(sum(result.factorisations for result in results)),
        "gradient_norm": float(np.max([result.gradient_norm for result in results])),  # nan where one is
        "converged": float(all(result.status == "converged" for result in results)),
        "relaxed": float(any(result.relaxed for result in results)),
    } | {f"energy/{name}": value for name, value in results[-1].terms.items()}


def _finite(value: np.ndarray, shape: tuple[int, ...], label: str) -> np.ndarray:
    """Return a copy of finite numbers of this shape. Raises ValueError for any others."""
    value = np.array(value, dtype=np.float64)
    if value.shape != shape or not np.isfinite(value).all():
        raise ValueError(f"simulate: {label} is {value.shape}: finite numbers {shape} are due")
    return value
